"""Recordings to correct: which columns they are, and in which units."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipelines.export.corrected import corrected
from pipelines.export.recording import read_recording, recording_of
from schemas.errors import DataRejected, WrongUse


def test_columns_have_names_or_numbers_and_another_unit_than_that_of_the_calibration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t [s],t [ms],ax [mV],ay [mV],az [mV]\n0,0,1,2,3\n1,1000,1,2,4\n")
    assert read_recording(path, ["3", "4", "5"], time="1", unit="mV").output.tolist() == [[1, 2, 3], [1, 2, 4]]
    with pytest.raises(WrongUse, match=r"column 'ax \[mV\]' states mV, V is needed; convert the column"):
        read_recording(path, ["ax [mV]", "4", "5"], time="1", unit="V")
    with pytest.raises(WrongUse, match=r"column 't \[ms\]' states ms, s is needed"):
        read_recording(path, ["3", "4", "5"], time="2", unit="mV")


def test_points_in_time_are_seconds_and_a_condition_with_a_gap_is_refused_by_its_row() -> None:
    moments = pd.date_range("2026-03-29 01:59:59", periods=3, freq="s", tz="Europe/Berlin")
    table = pd.DataFrame({"time_s": moments, "x": 1.0, "y": 2.0, "z": 3.0, "unit_C": [25.0, 26.0, 27.0]})
    assert recording_of(table, "t").time.tolist() == [0.0, 1.0, 2.0]
    assert recording_of(table.astype({"unit_C": object}), "t").state.temperature.tolist() == [25.0, 26.0, 27.0]
    with pytest.raises(DataRejected, match="t: row 2, column 'unit_C': found -, a finite number"):
        recording_of(table.assign(unit_C=["25", "-", "27"]), "t")
    warm = recording_of(table.drop(columns="unit_C").assign(note="-", temp_degC=25.0), "t")
    model = ("scale", "bias_temperature")
    fit: Any = SimpleNamespace(run="r", effects=model, coefficients=np.ones((3, 2)), nonlinear={})
    with pytest.raises(DataRejected, match=r"t: no column unit_C, .* this name \(further columns: temp_degC\)"):
        corrected(warm, fit, None)
    with pytest.raises(DataRejected, match="t: column 'x' is there twice"):
        recording_of(pd.concat([table, table[["x"]]], axis=1), "t")
