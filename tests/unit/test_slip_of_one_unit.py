"""A table that slips under a single unit is told as such: its two angles explain the outputs better than any effect."""

import sys
from pathlib import Path

import pytest

from pipelines.diagnosis.diagnose import diagnose

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from noise import Noise
from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

SLIP_MRAD = 0.35
NOISE = Noise(white=25.0, flicker=30.0)


def said(world: World, seed: int) -> tuple[dict, tuple[int, ...]]:
    made = make(world, 6_100_000 + seed)
    (fault,) = made.faults
    return diagnose(made.dwells, made.history), fault.dwells


@pytest.mark.parametrize(("soaks", "poses"), [((-10.0, 25.0, 60.0), 24), ((-10.0, 25.0, 60.0), 12), ((22.0,), 24)])
@pytest.mark.parametrize("seed", [2, 3])
def test_the_slip_of_a_table_under_one_unit_is_named_and_no_physics(
    soaks: tuple[float, ...], poses: int, seed: int
) -> None:
    world = World(units=1, soaks=soaks, poses=poses, noise=NOISE, fault="table_slip", amount=SLIP_MRAD)
    document, dwells = said(world, seed)
    (group,) = document["classes"]
    assert group["effects"][0] == "table_slip"
    assert group["scope"] == "data"
    assert group["dwells"] == list(dwells)
    assert document["recommended"] == []


@pytest.mark.parametrize("seed", [2, 3])
def test_a_unit_that_turned_in_its_seat_is_not_told_as_a_slip_of_the_table(seed: int) -> None:
    world = World(units=1, noise=NOISE, fault="unit_moved", amount=0.5)
    document, dwells = said(world, seed)
    (group,) = document["classes"]
    assert group["effects"][0] == "unit_moved"
    assert group["dwells"] == list(dwells)
