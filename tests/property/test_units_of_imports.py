"""An import of one measurement is one table in g, whatever unit, order and signs of the axes its file has."""

import numpy as np
import pandas as pd
import pytest
from generated import SOME
from hypothesis import given
from hypothesis import strategies as st

from inertial.quantities import OUTPUT_COLUMNS, SLOW_COLUMNS, SPREAD_COLUMNS
from pipelines.importers.mapping import OUTPUT_UNITS, build
from pipelines.importers.record import imported
from pipelines.rerun.import_steps import zero_of_import
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

COUNTS_PER_G = 16384
PER_G = {"g": 1.0, "mg": 1e3, "m/s^2": STANDARD_GRAVITY_M_S2, "V": 0.66, "mV": 660.0, "LSB": float(COUNTS_PER_G)}
MEASURED = {"x": "o_x", "y": "o_y", "z": "o_z", "temperature": "heat", "dwell": "position"}
STATED = {
    **{name: name for name in (*SPREAD_COLUMNS, "unit", "force_x", "force_y", "force_z")},
    "n": "n",
    "duration": "took",
    "vibration": "shaken",
}
ORDERS = st.tuples(st.permutations(AXES), st.tuples(*[st.sampled_from("+-")] * 3))
AS_MEASURED = (AXES, ("+", "+", "+"))
FILES = given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(PER_G)), ORDERS)


def towards(rng: np.random.Generator, positions: int) -> np.ndarray:
    direction = rng.normal(size=(positions, 3))
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def of_means(rng: np.random.Generator) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """A file of dwells without its outputs; means and standard deviations in g."""
    force = towards(rng, 12)
    frame = pd.DataFrame({f"force_{axis}": force[:, k] for k, axis in enumerate(AXES)})
    frame = frame.assign(unit="A1", position=range(12), n=100, took=10.0, shaken=1e-3, heat=rng.normal(25.0, 1.0, 12))
    return frame, 1.01 * force + 0.02, rng.uniform(1e-4, 2e-4, (12, 3))


def of_samples(rng: np.random.Generator) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """A file of samples without its outputs; whole counts in g, and no standard deviations."""
    counts = COUNTS_PER_G * np.repeat(towards(rng, 8), 40, axis=0) + rng.normal(0.0, 9.0, (320, 3))
    frame = pd.DataFrame({"position": np.repeat(np.arange(8), 40), "heat": rng.normal(25.0, 1.0, 320)})
    return frame, np.rint(counts) / COUNTS_PER_G, np.zeros((0, 3))


def in_g(frame, output, spread, columns, unit, order, **keys) -> pd.DataFrame:
    """The dwells of a file in a unit, with its axes in an order and with signs, as they are after the import; outputs in g."""
    axes, signs = order
    file = frame.copy()
    for k, (axis, sign) in enumerate(zip(axes, signs, strict=True)):
        file[f"o_{axis}"] = float(f"{sign}1") * PER_G[unit] * output[:, k]
        if spread.size:
            file[f"sd_{axis}"] = PER_G[unit] * spread[:, k]
    content = {"columns": columns, "units": {"output": unit}, "unit": "A1", "axes": axes, "signs": signs}
    dwells = imported(file, build(content | keys, "t"), "f.csv").dwells
    assert dwells is not None
    scaled = dwells.columns.intersection([*OUTPUT_COLUMNS, *SPREAD_COLUMNS, *SLOW_COLUMNS])
    dwells[scaled] /= PER_G[dwells["out_unit"].iloc[0]]
    return dwells.drop(columns="out_unit").sort_index(axis=1)


def test_every_unit_of_outputs_is_tried():
    assert set(PER_G) == set(OUTPUT_UNITS)


@SOME
@FILES
def test_dwells_measured_by_others_are_the_same_in_g(seed, unit, order):
    file = of_means(np.random.default_rng(seed))
    plain = in_g(*file, MEASURED | STATED, "g", AS_MEASURED, rows="dwells")
    there = in_g(*file, MEASURED | STATED, unit, order, rows="dwells")
    pd.testing.assert_frame_equal(there, plain, rtol=1e-12)
    np.testing.assert_allclose(plain[[*SPREAD_COLUMNS]], file[2])


@SOME
@FILES
def test_dwells_of_samples_are_the_same_in_g(seed, unit, order):
    file, keys = of_samples(np.random.default_rng(seed)), {"rate_hz": 10.0}
    plain = in_g(*file, MEASURED, "g", AS_MEASURED, **keys)
    pd.testing.assert_frame_equal(in_g(*file, MEASURED, unit, order, **keys), plain, rtol=1e-9)


@pytest.mark.parametrize("unit", OUTPUT_UNITS)
def test_the_stated_output_at_0_g_is_in_the_unit_of_the_file(unit):
    columns = {axis: axis for axis in AXES}
    mapping = build({"columns": columns, "units": {"output": unit}, "zero_output": 0.25 * PER_G[unit]}, "t")
    about = {"mapping": mapping.model_dump(mode="json")}
    assert zero_of_import(about) == pytest.approx(0.25 * PER_G[OUTPUT_UNITS[unit][0]])
