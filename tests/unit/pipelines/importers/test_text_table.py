"""Text as devices write it: preambles, integer headers, decimal commas, byte-order marks, units in a line of their own."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import recordings
from each import each

from inertial.errors import NotIdentified
from pipelines.importers import files, sources
from pipelines.importers.clocks import stamps
from pipelines.importers.content import Content
from pipelines.importers.inspection import inspect
from pipelines.importers.mapping import build
from pipelines.importers.record import imported
from pipelines.importers.text_table import content
from pipelines.importers.unit_check import unsigned_bits
from pipelines.tables.norms import refuse_one_pose
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


def read(tmp_path: Path, text: str, encoding: str = "utf-8") -> Content:
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    return files.read_content(tmp_path / "a.csv")[0]


def inspected(tmp_path: Path, text: str) -> dict[str, Any]:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    return inspect([tmp_path / "a.csv"]).document


@each(CASES)
def test_the_table_is_found_and_what_was_passed_over_is_said(name: str, tmp_path: Path) -> None:
    text, names, first, remark = CASES[name]
    found = read(tmp_path, text)
    assert list(found.table.columns) == names
    np.testing.assert_allclose(found.table.iloc[0].to_numpy(dtype=float), first)
    assert remark in "; ".join(found.remarks)
    assert (remark == "") == (found.remarks == ())


@each([
    ("utf-8-sig", ""), ("utf-16", "text in UTF-16"), ("cp1252", "text in Windows-1252"),
    ("utf-16-le", "text in UTF-16-LE"), ("utf-16-be", "text in UTF-16-BE"),
])  # fmt: skip
def test_text_of_other_encodings_is_read_and_said(row: tuple[str, str], tmp_path: Path) -> None:
    encoding, remark = row
    found = read(tmp_path, "t;T [°C]\r\n1;20\r\n2;21\r\n" + "3;22\r\n" * 20, encoding)
    assert list(found.table.columns) == ["t", "T [°C]"]
    assert dict(found.units) == {"T [°C]": "°C"}
    assert found.remarks == ((remark,) if remark else ())


def test_units_in_a_line_broken_rows_short_rows_and_rows_of_another_width_are_what_they_are(tmp_path: Path) -> None:
    found = read(tmp_path, "t;x;y\n[s];[g];[g]\n1;2;3\n2;3;4\n")
    assert (dict(found.units), len(found.table)) == ({"t": "s", "x": "g", "y": "g"}, 2)
    broken = read(tmp_path, "t,x,y\n1,abc,2\n2,3,4\n3,4,5\n4,5,6\n")
    assert broken.table["x"].tolist() == ["abc", "3", "4", "5"]
    short = read(tmp_path, "t,x,y,note\n0,1,2\n1,1,2,\n2,1,2,\n3,1,2\n4,1,2,\n5,1,2,\n")
    assert (list(short.table.columns)[:3], len(short.table), short.remarks) == (["t", "x", "y"], 6, ())
    with pytest.raises(DataRejected, match="rows from line 3 on do not have the 3 columns"):
        read(tmp_path, "logger\nt,x,y\n1,2,3\n2,3,4\n3,4,5,6\n4,5,6\n")


def test_stamps_of_bytes_that_are_no_text_are_refused() -> None:
    with pytest.raises(DataRejected, match=r"m: column 't': bytes that are no text .*; give seconds, or ISO stamps"):
        stamps(pd.Series([b"\xff\xfe", b"12:00:00"], name="t", dtype=object), "m")


def test_quotes_around_the_ends_of_lines_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    path.write_text('",unit_C,chamber_C\n"' + "".join(f',{k}.0,26.0\n"' for k in range(25, 55)))
    with pytest.raises(
        DataRejected, match=r"history\.csv: rows that do not divide into the columns .*; check the quotes"
    ):
        files.read(path)


def test_a_line_break_in_a_quoted_field_of_every_row_is_part_of_the_field() -> None:
    rows = "".join(f'0.{k},1.{k},"moved\nagain"\n' for k in range(1, 7))
    table = content(f"t,x,note\n{rows}", "x.csv").table
    assert list(table.columns) == ["t", "x", "note"]
    assert table["x"].tolist() == [1.1, 1.2, 1.3, 1.4, 1.5, 1.6]
    assert set(table["note"]) == {"moved\nagain"}


COUNTS = [[16005, -416, 650], [-12, 1002, 999], [7, -1024, 16384]] * 10
PLAIN = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "unit": "A1", "units": {"output": "LSB"}}


def sheet(form: str, divider: str, rows: list[list[float]], *, quoted: bool = False) -> str:
    def word(value: float) -> str:
        text = format(value, form)
        return f'"{text}"' if quoted else text

    lines = [divider.join([f"{0.01 * k:.2f}", *map(word, row)]) for k, row in enumerate(rows)]
    return "\n".join([divider.join(["t", "ax", "ay", "az"]), *lines]) + "\n"


@pytest.mark.parametrize(
    ("text", "remark"),
    [
        (sheet(",", ",", COUNTS, quoted=True), "a comma between thousands"),
        (sheet(",", ";", COUNTS), "a comma between thousands"),
        (sheet(",.1f", ";", COUNTS).replace(".", "_").replace(",", ".").replace("_", ","), "a point between thousands"),
        (sheet(",", ";", COUNTS).replace(",", "'"), "an apostrophe between thousands"),
        (sheet(",", ";", COUNTS).replace(",", "\N{NARROW NO-BREAK SPACE}").replace(".", ","), "a space between thousands"),
    ],
)  # fmt: skip
def test_thousands_with_a_separator_are_counts(text: str, remark: str, tmp_path: Path) -> None:
    found = read(tmp_path, text)
    np.testing.assert_allclose(found.table[["ax", "ay", "az"]].to_numpy(dtype=float), COUNTS)
    np.testing.assert_allclose(found.table["t"], 0.01 * np.arange(len(COUNTS)))
    assert remark in "; ".join(found.remarks)


@each([(first, decimal) for first in (9.807, 0.123) for decimal in ".,"])
def test_three_decimals_are_no_thousands(row: tuple[float, str], tmp_path: Path) -> None:
    first, decimal = row  # also where none is below one
    rows = [[first, 1.204, -2.113], [first + 1.0, 1.206, 2.113]] * 20
    text = sheet(".3f", ";", rows)
    text = "\n".join(f"{k}{line[line.index(';') :]}" if k else line for k, line in enumerate(text.splitlines()))
    found = read(tmp_path, text.replace(".", decimal))
    np.testing.assert_allclose(found.table[["ax", "ay", "az"]].to_numpy(dtype=float), rows)
    assert not any("thousands" in one for one in found.remarks)


def test_minutes_and_seconds_of_a_spreadsheet_go_on_over_the_hour() -> None:
    times = stamps(pd.Series(["59:59,50", "59:59,75", "00:00,00", "00:00,25"], name="t"), "a.csv").seconds
    np.testing.assert_allclose(times, [0.0, 0.25, 0.5, 0.75])


def test_a_row_of_a_summary_is_left_out_where_gaps_may_be_and_rows_that_stand_twice_are_remarked_upon(
    rng: np.random.Generator,
) -> None:
    table = recordings.table(recordings.recording(rng))
    last = pd.DataFrame({"t": ["mean"], "ax": [0.0], "ay": [0.0], "az": [0.0]})
    summed = pd.concat([table.astype(object), last], ignore_index=True)
    recording = imported(summed, build(PLAIN | {"gaps": "split"}, "t"), "a.csv")
    assert len(recording.samples) == len(table)
    twice = pd.concat([table.iloc[:501], table.iloc[500:]], ignore_index=True)
    assert "CHECK THE ROWS: 1 rows" in "; ".join(imported(twice, build(PLAIN, "t"), "a.csv").remarks)
    assert "CHECK THE ROWS" not in "; ".join(imported(table, build(PLAIN, "t"), "a.csv").remarks)


def test_words_that_lost_their_sign_are_refused_with_what_to_subtract(rng: np.random.Generator, tmp_path: Path) -> None:
    table = recordings.table(recordings.recording(rng, positions=18))
    wrong = table.assign(**{name: np.round(table[name]) % 65536.0 for name in ("ax", "ay", "az")})
    with pytest.raises(DataRejected, match=r"signed words of 16 bits .* subtract 65536"):
        imported(wrong, build(PLAIN, "t"), "a.csv")
    assert any("without their sign" in one for one in inspected(tmp_path, wrong.to_csv(index=False))["open"])


@each([(12, 2048, 400), (12, 2048, 2000), (16, 32768, 4000), (10, 512, 100)])
def test_a_converter_with_its_zero_in_the_middle_lost_no_sign(
    row: tuple[int, int, int], rng: np.random.Generator
) -> None:
    bits, zero, per_g = row
    force = np.repeat(recordings.FACES, 50, axis=0)
    counts = np.clip(np.round(zero + per_g * force + rng.normal(0.0, 2.0, force.shape)), 0, 2**bits - 1)
    assert unsigned_bits(counts) == 0


def test_a_sheet_of_positions_is_proposed_as_dwells(tmp_path: Path) -> None:
    document = inspected(tmp_path, "Position;X;Y;Z\nX up;0,98;0,01;0,02\nX down;-1,01;0,01;0,02\nY up;0,0;1,0;0,0\n")
    assert document["open"] == []
    assert "dwell=Position" in document["command"]
    assert document["command"].endswith("--set rows=dwells")


FEWER = {
    "a": "x=a --unit-of output=UNIT,time=s --units a --set axes=x",
    "acc_x acc_z": "x=acc_x,z=acc_z --unit-of output=UNIT,time=s --units a --set axes=x,z",
    "U_V sd_V": "x=U_V --unit-of output=V,time=s --units a --set axes=x",
    "temp az": "temperature=temp,z=az --unit-of output=UNIT,time=s --units a --set axes=z",
}


@each(FEWER)
def test_a_record_of_one_axis_or_two_is_proposed_by_its_columns(heads: str, tmp_path: Path, rng) -> None:
    table = pd.DataFrame(rng.normal(1.0, 1e-3, (400, len(heads.split()))), columns=heads.split())
    document = inspected(tmp_path, table.assign(time=0.02 * np.arange(400)).to_csv(index=False))
    assert document["command"].endswith(f"--map time=time,{FEWER[heads]}")
    assert any("fewer than three axes" in one and "--set axes" in one for one in document["open"])
    assert not any("were not recognised" in one for one in document["open"])


def test_clocks_of_labelled_parts_that_restart_are_continued(rng: np.random.Generator) -> None:
    one = recordings.recording(rng, directions=recordings.FACES, moves=False)
    table = recordings.table(one, t=one.time)
    table["part"] = ""
    for number, (start, stop) in enumerate(one.spans):
        table.loc[start : stop - 1, "part"] = f"face {number}"
        table.loc[start : stop - 1, "t"] -= one.time[start]
    content = PLAIN | {"columns": {**PLAIN["columns"], "dwell": "part"}}  # type: ignore[dict-item]
    recording = imported(table[table["part"] != ""].reset_index(drop=True), build(content, "t"), "a.csv")
    assert bool(np.all(np.diff(recording.dwells["time_s"]) > 0.0))
    assert "the clock restarts 5 times" in "; ".join(recording.remarks)


def test_a_sensor_that_was_not_turned_is_told_so_and_what_to_do(rng: np.random.Generator) -> None:
    still = np.array([0.1, -0.05, -9.7]) + rng.normal(0.0, 0.05, (30, 3))
    with pytest.raises(NotIdentified, match=r"was not turned.*--set face=FACE"):
        refuse_one_pose(still)
    refuse_one_pose(np.concatenate([still, -still]))


SERIALS = ("007", "7", "1e5", "100000", "NaN", "NA", "TRUE", "0x1F", "12345678901234567890")


@each(["unit", "Part"])
def test_serial_numbers_stay_as_they_were_written_also_in_several_files(column: str, tmp_path: Path) -> None:
    for names in (("007",), ("1e5",), ("NaN",), SERIALS):
        rows = [f"{name};{k};{k},5;{0.1 * k:.1f};0.2;9.8".replace(".", ",") for name in names for k in range(4)]
        (tmp_path / "a.csv").write_text("\n".join([f"{column};no;t;x;y;z", *rows]) + "\n")
        found = files.read_content(tmp_path / "a.csv")[0]
        mapping = build({
            "columns": {"unit": column, "dwell": "no", "time": "t", "x": "x", "y": "y", "z": "z"},
            "units": {"output": "m/s^2", "time": "s"}, "rows": "dwells",
        }, "a.csv")  # fmt: skip
        assert set(imported(found.table, mapping, "a.csv", content=found).units) == set(names)
    for name, serial in (("a.csv", "007"), ("b.csv", "12")):
        (tmp_path / name).write_text(f"{column},t,x\n{serial},0,0.1\n{serial},1,0.2\n")
    joined, _, _ = sources.read([tmp_path / "a.csv", tmp_path / "b.csv"], join="rows", time="t")
    assert list(map(str, joined.named(column))) == ["007", "007", "12", "12"]
