"""Dwells and temperatures of a lot as arrays, whatever the order of the rows they come in."""

import numpy as np
import pandas as pd

from pipelines.tables.dwells import lot_arrays, lot_of, measured
from pipelines.tables.frames import ByUnit

UNITS, DWELLS = ("A1", "B2", "C3"), 5


def dwells(rng: np.random.Generator) -> pd.DataFrame:
    unit, dwell = (index.ravel() for index in np.indices((len(UNITS), DWELLS)))
    numbers = ("time_s", "out_x", "out_y", "out_z", "force_x", "force_y", "force_z", "unit_C")
    columns = {name: rng.normal(size=unit.size) for name in numbers}
    columns |= {name: rng.uniform(1.0, 2.0, unit.size) for name in ("sd_x", "sd_y", "sd_z")}
    kind = np.where(dwell < 3, "dwell", np.where(dwell < 4, "verification", "allan"))
    known = {"unit": np.array(UNITS, dtype=object)[unit], "dwell": dwell, "kind": kind, "pose": dwell.astype(str)}
    return pd.DataFrame(known | columns | {"out_unit": "V", "slot": unit, "n": 100})


def history(rng: np.random.Generator) -> pd.DataFrame:
    time, unit = (index.ravel() for index in np.indices((6, len(UNITS))))
    names = np.array(UNITS, dtype=object)[unit]
    frame = pd.DataFrame({"time_s": 10.0 * time, "unit": names, "unit_C": rng.normal(size=time.size)})
    frame.loc[4, "unit_C"] = np.nan
    return frame


def test_arrays_hold_the_rows_of_every_unit(rng: np.random.Generator) -> None:
    table, temperatures = dwells(rng), history(rng)
    lot = lot_arrays(table, temperatures)
    own, told = table[table["unit"] == "B2"], temperatures[temperatures["unit"] == "B2"].dropna()
    np.testing.assert_array_equal(lot.output[1], own[["out_x", "out_y", "out_z"]])
    np.testing.assert_allclose(lot.standard_error[1], own[["sd_x", "sd_y", "sd_z"]] / 10.0)
    expected = np.interp(lot.state.history.time, told["time_s"], told["unit_C"])
    np.testing.assert_array_equal(lot.state.history.temperature[1], expected)
    lot, chosen = lot_arrays(table, kinds=("dwell", "verification")), lot_arrays(table[table["kind"] != "allan"])
    assert lot.dwells.tolist() == [0, 1, 2, 3]
    np.testing.assert_array_equal(lot.output, chosen.output)
    assert lot.kinds.tolist() == chosen.kinds.tolist()


def test_a_unit_without_temperatures_leaves_the_lot_without_a_history(rng: np.random.Generator) -> None:
    temperatures = history(rng)
    for missing in (temperatures[temperatures["unit"] != "C3"], temperatures.iloc[:0]):
        assert lot_arrays(dwells(rng), missing).state.history is None
    more = lot_arrays(dwells(rng).query("unit != 'A1'"), temperatures).state.history
    assert more.temperature.shape[0] == 2


def test_rows_of_a_unit_are_found_together_and_scattered(rng: np.random.Generator) -> None:
    table = dwells(rng)
    mixed = table.sample(frac=1.0, random_state=3)
    for unit in UNITS:
        np.testing.assert_array_equal(ByUnit(table).of(unit)["out_x"], table[table["unit"] == unit]["out_x"])
        np.testing.assert_array_equal(ByUnit(mixed).of(unit)["out_x"], mixed[mixed["unit"] == unit]["out_x"])
    assert ByUnit(table).units == list(UNITS)
    assert len(ByUnit(table).of("elsewhere")) == len(ByUnit(table.iloc[:0]).of("A1")) == 0


def test_a_scatter_of_zero_is_none_and_that_of_the_other_units_counts(rng: np.random.Generator) -> None:
    force = rng.normal(size=(24, 3))
    known = {"unit": np.repeat(UNITS, 24), "dwell": np.tile(np.arange(24), 3), "time_s": np.tile(np.arange(24.0), 3)}
    more = {
        "kind": "dwell",
        "pose": "p",
        "out_unit": "g",
        "slot": 0,
        "n": 100,
        "sd_x": 1e-3,
        "sd_y": 1e-3,
        "sd_z": 2e-3,
    }
    table = pd.DataFrame(known | more)
    for axis, letter in enumerate("xyz"):
        table[f"force_{letter}"] = table[f"out_{letter}"] = np.tile(force[:, axis], 3)
    table.loc[table["unit"] == "B2", ["sd_x", "sd_y", "sd_z"]] = 0.0
    error = lot_of(measured(table)).error
    np.testing.assert_allclose(error[1], 2e-4)
    np.testing.assert_allclose(error[0], np.tile([1e-4, 1e-4, 2e-4], (24, 1)))
    np.testing.assert_allclose(lot_of(measured(table.assign(sd_x=0.0, sd_y=0.0, sd_z=0.0))).error, 1e-6)
