"""What is handed out names its certificate: exports and reports say whether one holds, was revoked, or never was given."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from capture_double import small_run
from ledger_events import day
from typer.testing import Result

from pipelines.archive import Run
from pipelines.certificates.days import months_after
from pipelines.export import unit_calibrations
from pipelines.integrity import verify
from pipelines.jobs.model_change import change_from_options
from pipelines.report import make_report
from pipelines.rerun.rerun import again
from schemas.errors import WrongUse

Typed = Callable[..., Result]
PX4 = ("--format", "px4", "--set", "nominal=256000", "--units", "A1", "--set", "device_id=1310988")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A run without a report: ledger commands draw the report again only where there is one, which takes their time."""
    return small_run(tmp_path, {"A3": "silent"})


def units(typed: Typed, run: Run, *words: str) -> dict[str, dict]:
    return {one["unit"]: one for one in json.loads(typed("export", run.id, *words).stdout)["units"]}


def test_an_export_names_the_certificate_and_whether_it_holds(run: Run, typed: Typed) -> None:
    done = typed("export", run.id)
    assert "not certified: A1, A2; 'tumbleline certificate issue" in done.stderr
    typed("certificate", "issue", run.id)
    assert typed("export", run.id).stderr == ""
    wanted = {
        "certificate": "A1/1", "from": day(), "until": months_after(day(), 12), "state": "valid", "reason": "", "valid_now": True,
    }  # fmt: skip
    assert units(typed, run)["A1"]["certificate"] == wanted
    line = f"certificate A1/1, valid from {day()} until {months_after(day(), 12)}"
    assert f"/* A1: {line} */" in typed("export", run.id, "--format", "c").stdout
    assert f"# {line}\n" in typed("export", run.id, *PX4).stdout
    assert line in typed("export", run.id, "--format", "csv").stdout.splitlines()[1]


def test_a_certificate_that_has_ended_is_told(run: Run, typed: Typed, monkeypatch: pytest.MonkeyPatch) -> None:
    typed("certificate", "issue", run.id, "--until", day(30))
    for place in ("pipelines.certificates.days.today", "pipelines.certificates.validity.today"):
        monkeypatch.setattr(place, lambda: day(31))
    assert units(typed, run)["A1"]["certificate"]["valid_now"] is False
    assert f"A1: certificate A1/1, valid from {day()} until {day(30)}" in typed("export", run.id).stderr


def test_revoked_coefficients_leave_the_house_only_when_they_are_asked_for(run: Run, typed: Typed) -> None:
    typed("certificate", "issue", run.id)
    typed("certificate", "revoke", "A1", "--reason", "dropped */ on the floor")
    done = typed("export", run.id)
    assert [one["unit"] for one in json.loads(done.stdout)["units"]] == ["A2"]
    assert "left out: A1, certificate A1/1 REVOKED (dropped */ on the floor)" in done.stderr
    refused = typed("export", run.id, "--units", "A1")
    assert "the calibration of unit A1" in str(refused.exception)
    given = typed("export", run.id, "--units", "A1", "--include", "revoked")
    assert json.loads(given.stdout)["units"][0]["certificate"]["state"] == "revoked"
    assert "A1: certificate A1/1 REVOKED" in given.stderr
    header = typed("export", run.id, "--units", "A1", "--include", "revoked", "--format", "c").stdout
    assert "REVOKED (dropped * / on the floor) */" in header
    typed("certificate", "revoke", "A2", "--reason", "wrong reference")
    assert "was revoked (" in str(typed("export", run.id).exception)  # no unit is left
    typed("certificate", "issue", run.id, "--units", "A1", "--reason", "dropped on foam")
    assert units(typed, run)["A1"]["certificate"]["certificate"] == "A1/3"


def test_the_report_names_the_certificates_and_follows_the_ledger(run: Run, typed: Typed) -> None:
    make_report(run)
    assert "No unit of this run had a certificate" in run.report.read_text(encoding="utf-8")
    typed("certificate", "issue", run.id)
    page = re.sub(r"<[^>]*>", " ", run.report.read_text(encoding="utf-8"))
    assert re.search(rf"A1\s+A1/1\s+{day()}\s+{months_after(day(), 12)}\s+valid", page)
    assert re.search(r"A3\s+not certified", page)
    typed("certificate", "revoke", "A1", "--reason", "dropped")
    page = re.sub(r"<[^>]*>", " ", run.report.read_text(encoding="utf-8"))
    assert re.search(rf"A1\s+A1/1\s+{day()}\s+{day()}\s+revoked\s+dropped", page)
    assert verify(run.archive, keys={}).checked.findings == []
    assert make_report(run)


STRICT = 'name = "strict"\n[figures]\nresidual_rms_ug = {max = 0.001, unit = "µg"}\n'


def test_failed_units_are_marked_in_their_files_and_no_certificate_is_offered_for_them(
    run: Run, typed: Typed, tmp_path: Path
) -> None:
    (tmp_path / "strict.toml").write_text(STRICT, encoding="utf-8")
    failed = again(run.archive, run.id, change_from_options(limits=str(tmp_path / "strict.toml"))).new
    mark = "FAILED: grade consumer, outside its limits: Rms residual of the fit: "
    for words in (PX4, ("--format", "csv"), ("--format", "c")):
        done = typed("export", failed, "--include", "failed", *words)
        assert mark in done.stdout, (words, done.stderr)
        assert f"export: A1 {mark}" in done.stderr
        assert "certificate issue" not in done.stderr
    with pytest.raises(
        WrongUse, match=r"^unit A1 failed \(Rms residual of the fit: "
    ):  # as correct and simulate read it
        unit_calibrations(run.archive.run(failed), ("A1",), failed=False)
    passed = typed("export", run.id, "--format", "csv")
    assert "FAILED" not in passed.stdout
    assert f"'tumbleline certificate issue {run.id} --archive " in passed.stderr
