"""Handling errors in a lot a part of which is searched first: told once, of the right unit, and no physics beside."""

import sys
from pathlib import Path

import pytest

from pipelines.diagnosis.diagnose import diagnose

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

UNITS = 40


@pytest.mark.parametrize(
    ("fault", "amount", "seed", "name"),
    [
        ("unit_moved", 0.3, 1, "unit_moved"), ("unit_moved", 0.3, 3, "unit_moved"),
        ("unit_unsoaked", 0.0, 4, "unit_not_soaked"), ("table_slip", 0.3, 4, "table_slip"),
        ("wrong_pose", 0.1, 6, "wrong_pose"),
    ],
)  # fmt: skip
def test_a_handling_error_in_a_large_lot_is_told_once_of_its_unit(
    fault: str, amount: float, seed: int, name: str
) -> None:
    made = make(World(units=UNITS, poses=12, fault=fault, amount=amount), 6_200_000 + seed)
    document = diagnose(made.dwells, made.history)
    (told,), (group,) = made.faults, document["classes"]
    assert group["effects"] == [name]
    assert tuple(group["units"]) == told.units
    assert tuple(group["dwells"]) == told.dwells
    assert document["recommended"] == []
