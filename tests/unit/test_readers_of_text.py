"""Text as devices write it: preambles, integer headers, decimal commas, byte-order marks, units in a line of their own."""

import numpy as np
import pytest

from pipelines.importers import files
from pipelines.importers.text_table import content
from schemas.errors import DataRejected

SPLIT = "t;ax;ay;az\n0,01;0,1;0,2;9,8\n0,02;0,1;0,2;9,7\n0,03;0,1;0,2;9,8\n"
CASES = {
    "preamble": ("Device: ACC-7\nSerial,1234\nRate,100\n\n" + SPLIT, ["t", "ax", "ay", "az"], [0.01, 0.1, 0.2, 9.8],
                 "3 lines before the header in line 5 were not read, beginning with 'Device: ACC-7'"),
    "preamble without a header": ("logger 2.1\nstarted 12:00\n1 2.5 3 4\n2 2.5 3 4\n3 2.5 3 4\n", ["1", "2", "3", "4"],
                                  [1, 2.5, 3, 4], "2 lines before the first row in line 3"),
    "integer header": ("0,1,2,3\n0.0,0.1,0.2,9.8\n0.1,0.1,0.2,9.8\n0.2,0.1,0.2,9.8\n", ["0", "1", "2", "3"],
                       [0.0, 0.1, 0.2, 9.8], "line 1 only numbers the columns"),
    "index column": (",0,1,2\n0,0.1,0.2,9.8\n1,0.1,0.2,9.8\n2,0.1,0.2,9.8\n", ["column 1", "0", "1", "2"],
                     [0, 0.1, 0.2, 9.8], "only numbers the columns"),
    "decimal comma, semicolon": (SPLIT, ["t", "ax", "ay", "az"], [0.01, 0.1, 0.2, 9.8], "decimal comma"),
    "decimal comma, blanks": ("1,5 2,5 3,5\n2,5 3,25 4\n", ["1", "2", "3"], [1.5, 2.5, 3.5], "decimal comma"),
    "decimal comma, quoted": ('t,"a, b"\n"0,01","0,98"\n"0,02","0,97"\n', ["t", "a, b"], [0.01, 0.98], "decimal comma"),
    "names in a comment": ("# t ax ay\n1 2 3.5\n2 3 4.5\n", ["t", "ax", "ay"], [1, 2, 3.5], "columns named by a comment"),
    "divider at the end": ("t,x,y,\n1,2,3,\n2,3,4,\n", ["t", "x", "y"], [1, 2, 3], ""),
    "rows that count": ("1 2 3\n2 3 4\n3 4 5\n", ["1", "2", "3"], [1, 2, 3], ""),
    "exponent of Fortran": ("t x\n0.0D+00 1.5D-01\n1.0D+00 2.5D-01\n", ["t", "x"], [0.0, 0.15], ""),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_the_table_is_found_and_what_was_passed_over_is_said(name: str, tmp_path) -> None:
    text, names, first, remark = CASES[name]
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    content, _ = files.read_content(tmp_path / "a.csv")
    assert list(content.table.columns) == names
    np.testing.assert_allclose(content.table.iloc[0].to_numpy(dtype=float), first)
    assert remark in "; ".join(content.remarks)
    assert (remark == "") == (content.remarks == ())


@pytest.mark.parametrize(
    ("encoding", "remark"), [("utf-8-sig", ""), ("utf-16", "text in UTF-16"), ("cp1252", "text in Windows-1252")]
)
def test_text_of_other_encodings_is_read_and_said(encoding: str, remark: str, tmp_path) -> None:
    (tmp_path / "a.csv").write_bytes("t;T [°C]\r\n1;20\r\n2;21\r\n".encode(encoding))
    content, _ = files.read_content(tmp_path / "a.csv")
    assert list(content.table.columns) == ["t", "T [°C]"]
    assert dict(content.units) == {"T [°C]": "°C"}
    assert content.remarks == ((remark,) if remark else ())


def test_units_in_a_line_of_their_own_are_units(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("t;x;y\n[s];[g];[g]\n1;2;3\n2;3;4\n", encoding="utf-8")
    content, _ = files.read_content(tmp_path / "a.csv")
    assert dict(content.units) == {"t": "s", "x": "g", "y": "g"}
    assert len(content.table) == 2


def test_a_broken_first_row_stays_a_row(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("t,x,y\n1,abc,2\n2,3,4\n3,4,5\n4,5,6\n", encoding="utf-8")
    table, _ = files.read(tmp_path / "a.csv")
    assert table["x"].tolist() == ["abc", "3", "4", "5"]


def test_rows_of_another_width_are_refused_below_a_preamble_too(tmp_path) -> None:
    (tmp_path / "a.csv").write_text("logger\nt,x,y\n1,2,3\n2,3,4\n3,4,5,6\n4,5,6\n", encoding="utf-8")
    with pytest.raises(DataRejected, match="rows from line 3 on do not have the 3 columns"):
        files.read(tmp_path / "a.csv")


def test_a_line_break_in_a_quoted_field_of_every_row_is_part_of_the_field() -> None:
    """It ended in a traceback of the csv library while the other dividers were tried."""
    rows = "".join(f'0.{k},1.{k},"moved\nagain"\n' for k in range(1, 7))
    table = content(f"t,x,note\n{rows}", "x.csv").table
    assert list(table.columns) == ["t", "x", "note"]
    assert table["x"].tolist() == [1.1, 1.2, 1.3, 1.4, 1.5, 1.6]
    assert set(table["note"]) == {"moved\nagain"}
