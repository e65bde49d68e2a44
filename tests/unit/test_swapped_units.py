"""Two units that were exchanged during a run are told with the dwell, and no physics is named for it."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial.data_errors.handling.units_swapped import UnitsSwapped
from pipelines.diagnosis.diagnose import diagnose
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from tables import FAULTS, HIDDEN, NULLS
from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

SEED = 6_300_000


@pytest.mark.parametrize(
    ("name", "seed"),
    [
        ("swapped", 1), ("swapped", 2), ("swapped", 3), ("swapped_thermometers", 1), ("swapped_thermometers", 2),
        ("swapped_alike", 1), ("swapped_alike", 2), ("swapped_two_units", 1), ("swapped_two_units", 2),
        ("swapped_two_units", 700_002),
        pytest.param("swapped_many_units", 1, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_units_that_were_exchanged_are_told_with_the_dwell_and_no_physics(name: str, seed: int) -> None:
    made = make(FAULTS[name], SEED + seed)
    document = diagnose(made.dwells, made.history)
    (told,), (group,) = made.faults, document["classes"]
    assert (group["effects"], group["scope"]) == (["units_swapped"], "data")
    assert (tuple(group["units"]), group["dwells"]) == (told.units, [told.dwells[0]])
    assert group["evidence"].startswith(f"{told.units[0]} and {told.units[1]}: exchanged before this dwell")
    assert (document["recommended"], document["unexplained"]) == ([], None)


def test_after_the_exchange_the_run_is_the_one_without_it() -> None:
    made = make(FAULTS["swapped"], SEED + 5)
    document = diagnose(made.dwells, made.history)
    assert document["error"]["rms_ug"] == pytest.approx(made.floor_ug, rel=0.4)


@pytest.mark.parametrize(
    "world", [*(NULLS[n] for n in ("B30", "K8", "two_units", "many_units")), HIDDEN["third_order_2"]]
)
def test_no_pair_is_searched_where_no_units_were_exchanged(world: World) -> None:
    lots = (make(world, SEED + 20 + seed) for seed in range(5))
    assert [UnitsSwapped().places(lot_of(measured(one.dwells, one.history))) for one in lots] == [[]] * 5


def test_a_dwell_of_an_exchanged_unit_is_no_wrong_pose() -> None:
    made = make(World(differ=0.4, fault="units_swapped"), SEED + 112)
    document = diagnose(made.dwells, made.history)
    (told,), (group,) = made.faults, document["classes"]
    assert document["blocked_by"] == []
    assert (group["effects"], tuple(group["units"])) == (["units_swapped"], told.units)


def test_part_of_a_difference_between_two_units_is_no_exchange() -> None:
    made = make(World(units=4, differ=0.2), SEED + 30)
    dwells = made.dwells.copy()
    one, other = (dwells["unit"] == name for name in ("W001", "W003"))
    late = dwells["dwell"] >= 30
    for axis in ("out_x", "out_y", "out_z"):
        apart = 0.5 * (dwells.loc[one & late, axis].to_numpy() - dwells.loc[other & late, axis].to_numpy())
        dwells.loc[one & late, axis] -= apart
        dwells.loc[other & late, axis] += apart
    assert not any("units_swapped" in group["effects"] for group in diagnose(dwells, made.history)["classes"])
    assert not UnitsSwapped().possible(np.array([0.5]))
