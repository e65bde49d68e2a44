"""Recordings to correct: which columns they are, and in which units."""

from pathlib import Path

import pytest

from pipelines.export.recording import read_recording
from schemas.errors import WrongUse


def test_columns_have_names_or_numbers_and_another_unit_than_that_of_the_calibration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t [s],t [ms],ax [mV],ay [mV],az [mV]\n0,0,1,2,3\n1,1000,1,2,4\n")
    assert read_recording(path, ["3", "4", "5"], time="1", unit="mV").output.tolist() == [[1, 2, 3], [1, 2, 4]]
    with pytest.raises(WrongUse, match=r"column 'ax \[mV\]' states mV, V is needed; convert the column"):
        read_recording(path, ["ax [mV]", "4", "5"], time="1", unit="V")
    with pytest.raises(WrongUse, match=r"column 't \[ms\]' states ms, s is needed"):
        read_recording(path, ["3", "4", "5"], time="2", unit="mV")
