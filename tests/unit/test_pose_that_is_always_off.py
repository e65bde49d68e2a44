"""A pose that is wrong in every soak is told as such under a single unit, too, and its dwells are not told as bad ones."""

import sys
from pathlib import Path

import numpy as np
import pytest

from pipelines.diagnosis.diagnose import diagnose

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from tables import FAULTS
from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

SEED = 6_400_000


@pytest.mark.parametrize("name", ["pose_off_one_unit", "pose_off_one_unit_12", "pose_off_two_units"])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_pose_that_is_off_in_every_soak_is_told_and_no_dwell_and_no_physics(name: str, seed: int) -> None:
    made = make(FAULTS[name], SEED + seed)
    document = diagnose(made.dwells, made.history)
    (told,), (group,) = made.faults, document["classes"]
    assert (group["effects"][0], group["scope"], group["units"]) == ("pose_off", "data", [])
    assert tuple(group["dwells"]) == told.dwells
    assert (document["recommended"], document["unexplained"]) == ([], None)


@pytest.mark.parametrize("units", [1, 2])
@pytest.mark.parametrize("amount_mg", [0.5, 2.0, 5.0])
def test_a_dwell_that_is_off_in_one_soak_is_no_pose(units: int, amount_mg: float) -> None:
    made = make(World(units=units, fault="bad_dwell", amount=amount_mg), SEED + 10)
    (group,) = diagnose(made.dwells, made.history)["classes"]
    (told,) = made.faults
    assert (group["effects"], tuple(group["units"]), tuple(group["dwells"])) == (["bad_dwell"], told.units, told.dwells)


def test_two_dwells_of_a_pose_that_are_off_in_different_directions_are_bad_dwells() -> None:
    made = make(World(units=1), SEED + 20)
    dwells = made.dwells.copy()
    pose = dwells.loc[dwells["dwell"] == 5, ["outer_deg", "inner_deg"]].to_numpy()
    same = np.flatnonzero(np.all(np.abs(dwells[["outer_deg", "inner_deg"]].to_numpy() - pose) < 1e-6, axis=1))[:2]
    for axis, row in zip(("out_x", "out_y"), same, strict=True):
        dwells.loc[row, axis] += 1e-3
    document = diagnose(dwells, made.history)
    assert [group["effects"] for group in document["classes"]] == [["bad_dwell"]] * 2
    assert sorted(d for group in document["classes"] for d in group["dwells"]) == sorted(dwells.loc[same, "dwell"])
