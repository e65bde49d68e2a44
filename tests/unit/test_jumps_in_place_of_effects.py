"""Jumps of a few axes are not told as an effect of the whole lot, and an effect of the lot, an axis or a unit not as jumps."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from inertial.criticism.jumps import _evenness
from pipelines.diagnosis.diagnose import diagnose

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from tables import NOISES
from world import Made, World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

SEED = 6_500_000


def physics_alone(document: dict) -> list[list[str]]:
    return [group["effects"] for group in document["classes"] if group["scope"] != "data"]


def in_middle_soak(made: Made, axes: list[tuple[int, str]], size: float) -> pd.DataFrame:
    """The dwells with the bias of some axes of some units ``size`` g higher in the second of three soaks."""
    dwells = made.dwells.copy()
    middle = (dwells["dwell"] >= 24) & (dwells["dwell"] < 48)
    for unit, axis in axes:
        dwells.loc[(dwells["unit"] == f"W{unit + 1:03d}") & middle, f"out_{axis}"] += size
    return dwells


@pytest.mark.parametrize("axes", [[(1, "y"), (5, "y")], [(0, "x"), (3, "z"), (6, "y")]])
def test_axes_with_an_unsteady_bias_are_no_curve_over_temperature(axes: list[tuple[int, str]]) -> None:
    made = make(World(), SEED + 1)
    document = diagnose(in_middle_soak(made, axes, 500e-6), made.history)
    assert physics_alone(document) == []
    units = [tuple(group["units"]) for group in document["classes"] if "bias_unsteady" in group["effects"]]
    assert sorted(units) == sorted((f"W{unit + 1:03d}",) for unit, _ in axes)
    by_soak = [group["evidence"].split("(")[1].split(" µg")[0].split(", ") for group in document["classes"]]
    assert all(abs(float(text[1])) == pytest.approx(333.0, rel=0.3) for text in by_soak)


def test_an_axis_that_jumps_up_and_down_is_told_with_its_jumps_and_dwells() -> None:
    made = make(World(units=1), SEED + 2)
    dwells = made.dwells.copy()
    level = np.zeros(72)
    for dwell, size in ((1, -300e-6), (32, 250e-6), (33, -250e-6), (42, 320e-6)):
        level[dwell:] += size
    dwells["out_x"] += level[dwells["dwell"]]
    document = diagnose(dwells, made.history)
    assert physics_alone(document) == []
    told = {dwell for group in document["classes"] for dwell in group["dwells"]}
    told |= {row["dwell"] for row in document["removed"]["dwells"]}
    assert told & {0, 1}
    assert {32, 42} <= told


@pytest.mark.parametrize("units", ["all", "one"])
def test_a_curve_over_temperature_of_one_axis_or_of_one_unit_is_an_effect(units: str) -> None:
    made = make(World(), SEED + 3)
    sizes = np.random.default_rng(3).uniform(0.7, 1.3, (8, 3))
    chosen = [(u, "y") for u in range(8)] if units == "all" else [(4, axis) for axis in "xyz"]
    dwells = made.dwells
    for unit, axis in chosen:
        dwells = in_middle_soak(
            Made(dwells, made.history, made.fresh, made.fresh_history, (), 0.0),
            [(unit, axis)],
            900e-6 * sizes[unit, "xyz".index(axis)],
        )
    assert any("bias_temperature_quadratic" in group for group in physics_alone(diagnose(dwells, made.history)))


@pytest.mark.parametrize("name", ["telegraph_3000s", "telegraph_900s"])
@pytest.mark.parametrize("seed", range(2))
def test_slow_telegraph_noise_is_no_physics(name: str, seed: int) -> None:
    made = make(NOISES[name], SEED + 10 + seed)
    assert physics_alone(diagnose(made.dwells, made.history)) == []


def test_coefficients_of_one_distribution_are_even_and_two_of_many_are_not() -> None:
    rng = np.random.default_rng(5)
    even = [_evenness(40.0 * rng.standard_normal(24) ** 2) for _ in range(200)]
    assert np.mean(np.array(even) < -5.0) < 0.05
    assert _evenness(np.array([600.0, 150.0, *np.full(22, 1.0)])) < -50.0
    assert _evenness(np.array([141.0, 0.0, 0.0])) > -20.0  # three axes cannot say much
