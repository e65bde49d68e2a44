"""A bias that jumps between two dwells of a long run is placed in the right gap, and leaves no dwell to another cause."""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from inertial import effects as catalogue
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from pipelines.diagnosis.diagnose import diagnose
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from noise import Noise
from world import World, make

MODEL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
UNITS, POSES, SOAKS = 4, 48, 3
JUMP_UG = 300.0


@cache
def run(seed: int, units: int = UNITS, poses: int = POSES) -> tuple[pd.DataFrame, pd.DataFrame]:
    made = make(World(units=units, poses=poses, noise=Noise(white=25.0, flicker=30.0)), 5_900_000 + seed)
    return made.dwells, made.history


def jumping(dwells: pd.DataFrame, dwell: int, seed: int, jump_ug: float = JUMP_UG) -> pd.DataFrame:
    """The dwells with a bias that is another from a dwell on, in every axis of every unit."""
    rng, dwells = np.random.default_rng(seed), dwells.copy()
    for unit in dwells["unit"].unique():
        later = (dwells["unit"] == unit) & (dwells["dwell"] >= dwell)
        for axis in "xyz":
            dwells.loc[later, f"out_{axis}"] += 1e-6 * jump_ug * rng.uniform(0.7, 1.3)
    return dwells


def gap_of(instant: float, dwells: pd.DataFrame) -> int:
    """The dwell of the first unit that begins next after an instant."""
    own = dwells[dwells["unit"] == dwells["unit"].iloc[0]].sort_values("dwell")
    return int(own["dwell"][own["time_s"] + 0.5 * own["duration_s"] > instant].iloc[0])


@pytest.mark.parametrize("later_s", [0.0, 12.0])
def test_a_step_is_placed_in_each_gap_of_a_run_longer_than_the_grid(later_s: float) -> None:
    # units read one after the other divide each gap, and the grid has one instant in five
    plain, history = run(1)
    lot = lot_of(measured(plain, history), square=False)
    state = replace(lot.state, time=lot.state.time + later_s * np.arange(UNITS)[:, None] / UNITS, memory={})
    effects = catalogue.get_all([*MODEL, "step_change"])
    (instant,) = effects[-1].parameters(state)
    assert len(instant.choices) < POSES * SOAKS - 3
    for dwell in range(40, 110, 3):
        later = (np.arange(POSES * SOAKS) >= dwell)[None, :, None]
        jumped = replace(lot, state=replace(state, memory={}), output=lot.output + 1e-6 * JUMP_UG * later)
        found = terms_of(effects, Problem(jumped))[-1].keywords["instant"]
        assert ((state.time > found).argmax(axis=1) == dwell).all()


@pytest.mark.parametrize("dwell", [72, 79])
def test_a_step_in_a_long_run_is_not_told_with_a_wrong_pose_beside_it(dwell: int, no_next_measurement: None) -> None:
    plain, history = run(2)
    dwells = jumping(plain, dwell, 2)
    document = diagnose(dwells, history)
    (group,) = document["classes"]
    assert group["effects"][0] == "step_change"
    assert "wrong_pose" not in group["effects"]
    assert document["blocked_by"] == []
    assert gap_of(group["nonlinear"]["instant"], plain) == dwell


def test_a_pose_missed_right_after_a_step_is_still_told(no_next_measurement: None) -> None:
    plain, history = run(2)
    dwells = jumping(plain, 72, 2)
    here = dwells["dwell"] == 72
    # the table turned by 0.5° of its inner axis: every unit feels the same other force
    turn = np.radians(0.5)
    outer, inner = np.radians(dwells.loc[here, "outer_deg"]), np.radians(dwells.loc[here, "inner_deg"])
    off = {
        "x": np.sin(outer) * (np.sin(inner + turn) - np.sin(inner)),
        "y": np.sin(outer) * (np.cos(inner + turn) - np.cos(inner)),
    }
    for axis, change in off.items():
        dwells.loc[here, f"out_{axis}"] += change
    document = diagnose(dwells, history)
    effects = [group["effects"] for group in document["classes"]]
    assert ["wrong_pose"] in effects
    assert any("step_change" in each for each in effects)
    (wrong,) = (group for group in document["classes"] if group["effects"] == ["wrong_pose"])
    assert wrong["dwells"] == [72]


@pytest.mark.parametrize(("dwell", "seed"), [(37, 4), (37, 5), (44, 3), (44, 4), (44, 5)])
def test_dwells_right_before_the_step_of_one_unit_are_not_told_as_bad(
    dwell: int, seed: int, no_next_measurement: None
) -> None:
    # without them every instant between their neighbours is as good: the step had stood before them and kept them bad
    plain, history = run(seed, 1, 24)
    document = diagnose(jumping(plain, dwell, seed, 2.0 * JUMP_UG), history)
    (group,) = document["classes"]
    assert group["effects"][0] == "step_change"
    assert document["removed"] is None or document["removed"]["dwells"] == []
