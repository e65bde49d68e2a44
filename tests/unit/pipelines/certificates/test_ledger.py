"""The ledger of calibrations: certified, superseded, revoked; no two of a unit on one day."""

import hashlib
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from capture_double import small_run
from each import each
from in_process import document_of, refused
from in_process import given as asked
from laboratory import LABORATORY
from ledger_events import day, event

from benchmarks.generated_ledger import write_events
from pipelines.certificates import Ledger
from pipelines.certificates.days import day_of, months_after
from schemas.errors import ArchiveUnusable, WrongUse


@pytest.fixture
def ledger(tmp_path: Path) -> Ledger:
    """One with a calibration for the year 2026."""
    made = Ledger(tmp_path)
    made.add(event())
    return made


NEXT = {"start": "2026-10-01", "until": "2027-10-01", "run": "r-2"}


def test_a_calibration_holds_from_its_first_day_is_written_once_and_ends_where_the_next_begins(
    ledger: Ledger, tmp_path: Path
) -> None:
    days = ("2025-12-31", "2026-01-01", "2026-12-31", "2027-01-01")
    held = [ledger.valid_at("A1", one) for one in days]
    assert [one and one.certificate for one in held] == [None, "A1/1", "A1/1", None]
    again, there = ledger.add(event())
    assert there
    assert [again] == ledger.events("A1")
    ledger.add(event(**NEXT))
    assert [e.action for e in ledger.events("A1")] == ["certify", "supersede"]
    assert ledger.valid_at("A1", "2026-09-30").run == "r-1"
    assert ledger.valid_at("A1", "2026-10-01").run == "r-2"
    assert [(one.state, one.until, one.stated_until) for one in ledger.calibrations("A1")] == [
        ("superseded", "2026-10-01", "2027-01-01"),
        ("valid", "2027-10-01", "2027-10-01"),
    ]
    [first] = tmp_path.glob("calibrations/*/*/000001.json")
    assert ledger.events("A1")[1].previous == hashlib.sha256(first.read_bytes()).hexdigest()
    first.unlink()
    with pytest.raises(ArchiveUnusable, match=r"has event 000002\.json where number 1 is needed"):
        ledger.valid_at("A1", "2026-11-01")


def test_one_that_begins_before_a_valid_one_is_refused_unless_it_supersedes(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    ledger.add(event(start="2026-06-01"))
    with pytest.raises(WrongUse, match=r"overlaps calibration A1/1 of run r-1, valid from 2026-06-01 to 2027-01-01"):
        ledger.add(event(start="2026-01-01", run="r-2"))
    assert len(ledger.events("A1")) == 1
    ledger.add(event(start="2026-01-01", run="r-2"), supersede=True)
    assert ledger.valid_at("A1", "2026-07-01").run == "r-2"


def test_what_is_revoked_holds_on_no_day_or_from_the_day_named_and_needs_a_reason(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    with pytest.raises(WrongUse, match="no reason is given"):
        ledger.revoke("A1", " ")
    with pytest.raises(WrongUse, match="unit 'A1' has no calibration"):
        ledger.revoke("A1", "why")
    ledger.add(event(until="2099-01-01"))
    with pytest.raises(WrongUse, match=r"there is no certificate A1/7 that still holds; there are A1/1"):
        ledger.revoke("A1", "why", certificate=7)
    ledger.add(event(until="2099-01-01"))
    ledger.revoke("A1", "fell to the floor", day="2026-05-05")
    assert ledger.valid_at("A1", "2026-05-04").certificate == "A1/1"
    assert ledger.valid_at("A1", "2026-05-05") is None
    ledger.revoke("A1", "the reference was wrong", certificate=1)
    assert ledger.valid_at("A1", "2026-05-04") is None
    assert [e.reason for e in ledger.events("A1")][1:] == ["fell to the floor", "the reference was wrong"]


def test_what_was_known_on_a_day_is_told_without_what_was_written_later_by_a_sound_clock(tmp_path: Path) -> None:
    ledger = Ledger(tmp_path)
    first = event(sequence=1, when="2026-01-02T08:00:00+00:00")
    write_events(tmp_path, [first, event(sequence=2, action="revoke", ends=(1,), when="2026-03-01T08:00:00+00:00")])
    assert ledger.valid_at("A1", "2026-02-01") is None
    assert ledger.valid_at("A1", "2026-02-01", known="2026-02-28").certificate == "A1/1"
    later = (datetime.now(UTC) + timedelta(hours=2)).isoformat(timespec="milliseconds")
    assert write_events(tmp_path, [event(f"S{i:02d}", sequence=1, when=later) for i in range(50)]) == 50
    assert sorted({one.serial for one in ledger.all()}) == ["A1", *(f"S{i:02d}" for i in range(50))]
    with pytest.raises(ArchiveUnusable, match="set this host's clock"):
        ledger.add(event("S07", **NEXT))
    assert len(ledger.events("S07")) == 1
    [path] = [path for path in tmp_path.glob("calibrations/*/*/*.json") if '"S07"' in path.read_text()]
    path.write_text(path.read_text().replace('"schema": 1', '"schema": 9'))
    with pytest.raises(ArchiveUnusable, match="has schema 9, this version knows up to 1; use a newer version"):
        ledger.valid_at("S07", "2026-02-01")


@each(["../../etc/x", "a/b", "a\\b", "A1\n", "", " A1", "A" * 65, "A1\x00"])
def test_serials_that_could_be_paths_or_lines_are_refused_and_write_nothing(serial: str, tmp_path: Path) -> None:
    with pytest.raises(WrongUse, match="correct the serial where it was entered") as problem:
        Ledger(tmp_path).add(event(serial))
    assert len(str(problem.value).splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
    assert Ledger(tmp_path).events(serial) == []


def test_two_kinds_of_device_under_one_serial_are_told(ledger: Ledger) -> None:
    other = event(**NEXT | {"device": "ADXL357"})
    with pytest.raises(WrongUse, match="the ledger knows this serial as ADXL355: two units have one serial"):
        ledger.add(other)
    ledger.revoke("A1", "was another unit", certificate=1)
    ledger.add(other)
    assert ledger.valid_at("A1", "2026-12-01").event.device == "ADXL357"
    later = event(**NEXT | {"device": "imported", "start": "2026-12-02", "run": "r-3"})
    assert ledger.add(later)[0].action == "supersede"  # an import states no device


def test_a_day_is_that_of_utc_and_months_end_on_the_last_day_where_there_is_no_such_day() -> None:
    for text, told in (
        ("2026-05-01", "2026-05-01"), ("2026-05-01T23:30:00-02:00", "2026-05-02"), ("2026-05-01T12:00:00Z", "2026-05-01"),
    ):  # fmt: skip
        assert day_of(text, "--at") == told
    with pytest.raises(WrongUse, match=r"--at: found '31\.12\.2026', a date such as 2026-05-01"):
        day_of("31.12.2026", "--at")
    assert months_after("2026-08-31", 6) == "2027-02-28"
    assert months_after("2026-01-15", 12) == "2027-01-15"


def test_units_that_passed_are_certified_and_show_tells_the_calibration_of_a_date_with_origin_and_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = small_run(tmp_path, {"A3": "silent"})
    Path("lab.toml").write_text(LABORATORY, encoding="utf-8")
    own = ("--archive", run.archive.root)
    document = document_of("certificate", "issue", run.id, *own, status=1)
    assert {one["serial"] for one in document["certified"]} == {"A1", "A2"}
    assert list(document["left_out"]) == ["A3"]
    assert f"unit A3 of run {run.id} did not pass" in refused("certificate", "issue", run.id, "--units", "A3", *own)
    shown = document_of("show", "A1", "--at", day(100), *own, status=0)
    calibration = shown["calibration"]
    assert (shown["valid"], calibration["run"]) == (True, run.id)
    wanted = run.table("coefficients").query("unit == 'A1'")
    assert [row["value"] for row in calibration["coefficients"]] == wanted["value"].tolist()
    assert calibration["made"]["code"] == run.manifest("coefficients")["code"]
    assert calibration["made"]["capture"] == run.about["capture"]
    shown = document_of("show", "A1", "--at", day(-1), *own, status=1)
    assert (shown["valid"], shown["calibration"]) == (False, None)
    status, printed, _ = asked("show", "A1", "--at", "2060-01-01", *own)
    assert (status, "expired" in printed, " valid " in printed.partition("\n")[2]) == (1, True, False)
    document_of("certificate", "revoke", "A2", "--reason", "returned damaged", *own)
    last = document_of("show", "A2", "--at", day(100), *own, status=1)["history"][-1]
    assert (last["state"], last["ended"]["reason"]) == ("revoked", "returned damaged")
    assert "unit 'B7' has no calibration in archive" in refused("show", "B7", "--at", "2026-01-01", *own)
    write = "--laboratory lab.toml"
    for words in (
        "show A22", "show A22 --at 2026-01-01", "certificate revoke A22 --reason x", f"certificate write A22 {write}",
        f"certificate write A22/1 {write}", "certificate list A22", "certificate issue latest --units A22", "lineage A22",
        "export latest --units A22", "rerun unit:A22",
    ):  # fmt: skip
        assert "did you mean A2" in refused(*words.split(), *own), words
    Path("units.csv").write_text("serial,wafer\nA22,W1\n", encoding="utf-8")
    assert document_of("attributes", "add", "units.csv", *own)["similar"]["A22"][0] == "A2"


def test_the_bare_command_given_again_amends_nothing_and_a_reason_of_the_same_day_does(ledger: Ledger) -> None:
    later = event(start="2026-03-01", until="2027-03-01")
    assert ledger.add(later, amend=False) == (ledger.events("A1")[0], True)
    assert len(ledger.events("A1")) == 1
    _, was_there = ledger.add(replace(later, covers="sweep", start="2026-03-02"), amend=False)
    assert not was_there  # another kind of calibration
    amended, _ = ledger.add(event(reason="the grade was misread"))
    assert ledger.add(event(reason="the grade was misread ")) == (amended, True)
    assert ledger.add(event()) == (amended, True)
    assert (amended.action, amended.ends, amended.reason) == ("supersede", (1,), "the grade was misread")
    assert ledger.valid_at("A1", "2026-01-01").event == amended
    assert ledger.add(later)[0].action == "supersede"
