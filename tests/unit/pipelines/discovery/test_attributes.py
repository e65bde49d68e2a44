"""Attributes of units and runs: appended, never rewritten; what follows from a result is no driver."""

from pathlib import Path

import pandas as pd
import pytest
from each import each

from pipelines.archive import Archive
from pipelines.archive.attributes import known_attributes
from pipelines.discovery.attributes import add_attributes, added_from, as_numbers, listed, sentences
from schemas.errors import WrongUse


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    made = Archive(str(tmp_path / "archive"))
    made.prepare()
    return made


def table(text: str) -> pd.DataFrame:
    """A table from rows of words; the first row has the names."""
    rows = [row.split(",") for row in text.split()]
    return pd.DataFrame(rows[1:], columns=rows[0])


def of(archive: Archive, *asked: str) -> list[str]:
    """Values of attributes, each asked for by unit, run and name."""
    return [known_attributes(archive).of(*words.split()) for words in asked]


def test_a_changed_value_is_a_new_row_and_the_newest_counts(archive: Archive) -> None:
    first = add_attributes(archive, table("serial,wafer,firmware A1,W1,2.0 A2,W2,2.0"), "serial", "first.csv")
    assert (first["added"], first["changed"], first["file"]) == (4, 0, "000001.json")
    assert first["unknown"] == ["A1", "A2"]
    again = add_attributes(archive, table("unit,wafer A1,W1 A2,W3 A3,"), "serial", "second.csv")
    assert (again["added"], again["changed"], again["unchanged"]) == (0, 1, 1)
    assert of(archive, "A2 r wafer", "A2 r firmware", "A3 r wafer") == ["W3", "2.0", ""]
    kept = sorted((Path(str(archive.root)) / "attributes").glob("*.json"))
    assert [place.name for place in kept] == ["000001.json", "000002.json"]
    assert "first.csv" in kept[0].read_text("utf-8")
    assert "0 new values, 1 changed, 1 as before" in sentences(again)[0]


def test_a_value_of_a_run_holds_for_its_units_unless_they_have_their_own_and_what_follows_from_a_result_is_not_taken(
    archive: Archive,
) -> None:
    add_attributes(archive, table("run,fixture r1,F1"), "run", "runs.csv")
    add_attributes(archive, table("serial,fixture A1,F2"), "serial", "units.csv")
    assert of(archive, "A1 r1 fixture", "B1 r1 fixture", "B1 r2 fixture") == ["F2", "F1", ""]
    added = add_attributes(archive, table("serial,grade,wafer A1,pass,W1"), "serial", "a.csv")
    assert added["refused"] == ["grade"]
    assert known_attributes(archive).names() == ["fixture", "wafer"]


REFUSED = {
    "lot,wafer A1,W1": "no column 'serial', one is needed",
    "serial A1": "no column beside serial",
    "serial,station A1,S1": "a column 'station', the name of a driver that every run has",
    "serial,grade A1,pass": "grade follow from the result",
    "serial,wafer ,W1": "a row without serial",
    "serial,wafer A1,W1 A1,W2": "two values of wafer for A1 (W1, W2)",
    "serial,assembled A1,2026-02-28 A2,2026-02-30": "2026-02-30 as assembled of A2, which no calendar has",
    "serial,wafer,wafer A1,W1,W2": "two columns 'wafer', names must differ",
}


@each([(encoding, separator) for encoding in ("utf-8-sig", "cp1252", "utf-16") for separator in ",;\t"])
def test_a_table_is_read_as_a_spreadsheet_saves_it(row: tuple[str, str], archive: Archive, tmp_path: Path) -> None:
    encoding, separator = row
    unit = f"{encoding}-{ord(separator)}"
    lines = ("serial,Größe", f"{unit},groß", "A2,")
    (tmp_path / "a.csv").write_text("\r\n".join(lines).replace(",", separator), encoding=encoding)
    added_from(archive, tmp_path / "a.csv", "serial")
    assert of(archive, f"{unit} r Größe") == ["groß"]


@each(REFUSED)
def test_tables_that_cannot_be_taken_leave_nothing(words: str, archive: Archive) -> None:
    with pytest.raises(WrongUse) as refusal:
        add_attributes(archive, table(words), "serial", "a.csv")
    assert REFUSED[words] in str(refusal.value)
    assert not (archive.root / "attributes").exists()


def test_numbers_are_quantities_where_they_have_fractions_or_are_dates() -> None:
    assert as_numbers(["1", "2", "13"]) is None  # numbers of wafers
    assert as_numbers(["0.5", "2", ""]) == {"0.5": 0.5, "2": 2.0}
    dates = as_numbers(["2026-03-01", "2026-03-04"])
    assert dates["2026-03-04"] - dates["2026-03-01"] == 3.0
    assert as_numbers(["W1", "0.5"]) is None
    assert as_numbers(["2026-02-28", "2026-02-30"]) is None  # of an earlier version, with a day that does not exist


def test_a_decimal_comma_is_read_where_commas_do_not_divide(archive: Archive, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("serial;radius\nA1;3,25\nA2;-4,5\nA3;1,2,3\n", encoding="utf-8")
    added_from(archive, tmp_path / "a.csv", "serial")
    assert of(archive, "A1 r radius", "A2 r radius", "A3 r radius") == ["3.25", "-4.5", "1,2,3"]


def test_how_a_column_is_judged_is_said(archive: Archive) -> None:
    added = add_attributes(archive, table("serial,wafer,radius,tested A1,W1,1.5,2026-03-01"), "serial", "a.csv")
    assert added["quantities"] == ["radius", "tested"]
    assert "quantities: radius, tested; labels: wafer" in sentences(added)
    added = add_attributes(archive, table("serial,radius A4,n/a"), "serial", "b.csv")
    assert added["quantities"] == []
    assert "labels: radius" in sentences(added)
    judged = {row["attribute"]: row["judged_as"] for row in listed(archive)["attributes"]}
    assert judged == {"wafer": "labels", "radius": "labels", "tested": "quantity"}


def test_a_date_after_today_is_told_once_and_kept(archive: Archive) -> None:
    added = add_attributes(archive, table("serial,assembled_on A1,2999-01-05 A2,2024-01-05"), "serial", "a.csv")
    assert added["future"] == ["2999-01-05 as assembled_on of A1"]
    told = "after today: 1 date (2999-01-05 as assembled_on of A1), today or earlier is needed"
    assert any(told in one for one in sentences(added))
    again = add_attributes(archive, table("serial,assembled_on A1,2999-01-05"), "serial", "b.csv")
    assert again["future"] == []
