"""Trouble with the archive: each is one clear message, nothing is lost, and the same command goes on afterwards."""

import re
import resource
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from capture_double import BRIEF, CaptureDouble, finished_run, recipe_file, small_job
from each import each
from in_process import document_of, given, text_of
from root_process import ROOT

from pipelines.archive import Archive, Run, hash_chain, provenance
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify
from pipelines.chain.runner import Runner
from pipelines.integrity import verify
from pipelines.jobs.job import Request
from schemas.errors import WrongUse

MORE = "bias,scale,misalignment,bias_temperature,scale_temperature,second_order"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """The archive of a finished run."""
    finished_run(tmp_path)
    return tmp_path / "archive"


def refused(words: str, *arguments: object) -> None:
    """A command ends with status 2 and one line that holds these words."""
    status, _, message = given(*arguments)
    assert (status, len(message.strip().splitlines())) == (2, 1), message
    assert words in message, arguments


def tables(run: Run) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(run.path.glob("*.parquet"))}


@pytest.mark.slow
def test_a_disk_that_fills_in_the_middle_of_a_rerun_loses_nothing(root: Path) -> None:
    archive = Archive(root)
    old = archive.run("latest")
    before = tables(old)
    command = [sys.executable, "-m", "pipelines.cli", "rerun", old.id, "--effects", MORE, "--archive", str(root)]

    def rerun(largest: int) -> subprocess.CompletedProcess[str]:
        """In a process that can write no file beyond a size: what it meets is a disk that is full."""
        most = (largest, resource.RLIM_INFINITY)
        full = partial(resource.setrlimit, resource.RLIMIT_FSIZE, most)
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT, preexec_fn=full)

    stopped = rerun(9_000)
    assert stopped.returncode == 1, stopped.stderr  # it tells of each run, and goes on
    assert "cannot be written (File too large)" in " ".join((stopped.stdout + stopped.stderr).split())
    assert tables(old) == before
    assert verify(archive, keys={}).checked.findings == []
    # the files of the new run are published together, or not at all
    assert [info.id for info in archive.runs()] == [old.id]
    assert rerun(10**9).returncode in {0, 1}
    [new] = [info.id for info in archive.runs() if info.id != old.id]
    assert set(tables(archive.run(new))) >= set(before)
    assert tables(old) == before
    assert verify(archive, keys={}).whole
    assert not list(root.rglob(".tmp-*"))


def test_a_foreign_table_anywhere_is_told_by_name_and_disturbs_nothing(root: Path) -> None:
    run = Archive(root).run("latest")
    for place in (f"runs/{run.id}", "runs", f"captures/{run.about['capture']}/00001", "."):
        path = root / place / "mine.parquet"
        pd.DataFrame({"a": [1]}).to_parquet(path)
        out = text_of("verify", "--archive", root, status=1)
        assert "mine.parquet" in out
        assert "import foreign files with 'tumbleline import'" in out
        text_of("list", "--archive", root, status=0)
        refused("no table is called 'mine'", "show", "latest", "mine", "--archive", root)
        path.unlink()
    pd.DataFrame({"a": [1]}).to_parquet(run.path / "grades.parquet")
    refused("was not written by this archive, table 'grades' is needed", "show", "latest", "grades", "--archive", root)


def test_what_a_newer_version_wrote_is_told_by_every_command(root: Path) -> None:
    manifest = Archive(root).run("latest").path / "dwells.json"
    manifest.write_text(manifest.read_text().replace('"schema": 1', '"schema": 8'))
    for command in (("show", "latest", "dwells"), ("export", "latest"), ("show", "latest", "--report")):
        refused("dwells.json has schema 8, this version knows up to", *command, "--archive", root)
    (root / "archive.json").write_text('{"format": 9, "product": "tumbleline"}\n')
    for command in (("list",), ("show", "latest"), ("show", "small"), ("verify",), ("lineage", "A1")):
        refused("has format 9, this version writes 1; use the version that wrote it", *command, "--archive", root)


@pytest.mark.slow
def test_a_clock_that_goes_backwards_loses_nothing_and_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A host whose clock fell back by a day writes a second lot: it is kept whole, and verify says so."""
    store = Archive(tmp_path / "archive")
    list(Runner(small_job(tmp_path), store, measure=CaptureDouble()).all())

    class Yesterday(datetime):
        @classmethod
        def now(cls, tz=None):
            return datetime.now(tz) - timedelta(days=1)

    monkeypatch.setattr(provenance, "datetime", Yesterday)
    later = Runner(small_job(tmp_path, ("seed = 5", "seed = 6")), store, measure=CaptureDouble())
    list(later.all())
    report = verify(store, keys={})
    assert report.checked.findings == []
    assert any("a clock was set back" in remark for remark in report.checked.remarks)
    assert len(store.runs()) == 2
    assert hash_chain.last_number(store.root) == 2


def test_a_day_that_no_calendar_has_and_a_serial_that_is_a_path_are_told_when_they_are_looked_up(root: Path) -> None:
    for day in ("0001-01-01T00:00:00+02:00", "9999-12-31T23:00:00-05:00", "2026-13-01", "tomorrow"):
        refused("a date such as 2026-05-01 is needed", "show", "A1", "--at", day, "--archive", root)
    refused(repr("../../etc/passwd"), "show", "../../etc/passwd", "--at", "2026-01-01", "--archive", root)


@each(("../../etc/passwd", "a/b", "A\n1", "A\\1", "\x1b[31mred", "A" * 65, "..", "\u0410\u0031", "A1\u200b"), repr)
def test_a_serial_that_could_be_a_path_or_a_line_is_refused_by_run_and_import(serial: str, tmp_path: Path) -> None:
    refused("", "run", "--direct", "--units", serial, "--archive", tmp_path / "a")
    frame = pd.DataFrame({"sn": [serial] * 200, "t": [0.01 * n for n in range(200)], "x": 0.0, "y": 0.0, "z": 1.0})
    frame.to_csv(tmp_path / "record.csv", index=False)
    command = ("import", tmp_path / "record.csv", "--unit-of", "output=g,time=s", "--archive", tmp_path / "a")
    refused("serial", *command, "--map", "time=t,x=x,y=y,z=z,unit=sn")
    refused("serial", *command, "--map", "time=t,x=x,y=y,z=z", "--units", serial)
    assert not (tmp_path / "a").exists()


@pytest.mark.slow
def test_two_units_with_one_serial_on_two_stations_at_once_are_refused(tmp_path: Path) -> None:
    """While one station measures A1, another measures an A1, too: only one of the two can be certified."""
    store = Archive(tmp_path / "archive")
    other: list[Run] = []

    def meanwhile(job, records, progress) -> None:
        if not other:
            runner = Runner(small_job(tmp_path, ("seed = 5", "seed = 6")), store, measure=CaptureDouble())
            other.append(runner.run)
            list(runner.all())
        CaptureDouble()(job, records, progress)

    first = Runner(small_job(tmp_path), store, measure=meanwhile)
    list(first.all())
    certify(Ledger(store), other[0])
    with pytest.raises(WrongUse, match=r"unit A1 was measured in run .* and in run .*: two units have one serial"):
        certify(Ledger(store), first.run)
    assert len(Ledger(store).events("A1")) == 1


def test_what_was_measured_with_an_overdue_standard_is_not_certified(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    due = (datetime.now(UTC) - timedelta(days=1)).date()
    station = tmp_path / "bench.toml"
    own = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")
    station.write_text(f'{own}\n[[reference]]\nid = "L-7"\ncertificate = "C 12"\ndue = {due}\n', encoding="utf-8")
    job = Request(recipe=recipe_file(tmp_path, *BRIEF), station=station).job()
    runner = Runner(job, Archive(tmp_path / "archive"), measure=CaptureDouble())
    list(runner.all())
    late = rf"reference standard L-7 \(certificate C 12\) was due on {due}"
    with pytest.raises(WrongUse, match=late):
        certify(Ledger(runner.run.archive), runner.run)
    monkeypatch.setattr("pipelines.cli.run.measured", lambda *_, **__: runner.run)
    words = ("run", recipe_file(tmp_path, *BRIEF), "--station", station, "--direct", "--archive")
    for archive, warned in (("new", True), ("archive", False)):  # where it is measured already nothing more is lost
        _, out, told = given(*words, tmp_path / archive)
        assert bool(re.search(late, told)) == warned
        assert "certificate issue" not in out


def test_a_run_json_that_was_lost_hides_no_other_run(root: Path) -> None:
    (root / "runs" / "empty").mkdir()
    (root / "runs" / "lost").mkdir()
    (root / "runs" / "lost" / "dwells.json").write_text("{}", encoding="utf-8")
    assert len(document_of("list", "--archive", root, status=0)["runs"]) == 1
    assert "folder runs/lost has no run.json" in given("list", "--archive", root)[2]
    refused("folder runs/lost has no run.json; restore it from a copy", "show", "lost", "--archive", root)
    told_of = document_of("verify", "--archive", root)
    assert [(f["kind"], f["path"]) for f in told_of["findings"]] == [("missing", "runs/lost/run.json")]
    assert told_of["remarks"] == ["runs/empty holds no run: its writer was killed, or has just started"]


def test_a_finished_run_that_lost_a_table_or_whose_table_has_changed_is_told_as_such(root: Path) -> None:
    run = Archive(root).run("latest")
    for name in ("grades", "verdict"):
        place = run.path / f"{name}.parquet"
        data = place.read_bytes()
        place.unlink()
        out = text_of("list", "--archive", root, status=1)
        assert ("files missing" in out, "not graded" in out) == (True, False)
        assert f"{name}.parquet not there; restore from a copy, see 'tumbleline verify {run.id}'" in out
        for words in (("show", "latest"), ("show", "latest", name)):
            refused(f"run {run.id} is finished, and {name}.parquet of it is not there", *words, "--archive", root)
        text_of("show", "latest", "figures", "--archive", root, status=0)
        place.write_bytes(data)
    assert given("show", "latest", "--archive", root)[::2] == (0, "")
    for name in ("coefficients", "covariance"):
        place = run.path / f"{name}.parquet"
        data = place.read_bytes()
        place.write_bytes(data + b"x")
        status, out, message = given("show", "latest", "--archive", root)
        assert (status, "passed" in out) == (1, True)
        assert f"{name}.parquet has changed since it was written" in message
        place.write_bytes(data)


def test_a_name_that_no_run_has_and_a_place_without_an_archive_are_told(tmp_path: Path) -> None:
    store = Archive(tmp_path / "archive")
    for n in range(60):
        store.open_run("lot", {"lot": {"units": []}}, n)
    words = "'lates' is no run, and no unit with a certificate; did you mean latest?"
    refused(words, "show", "lates", "--archive", store.root)
    for name in ("zzzz", "lot"):
        _, _, message = given("show", name, "--archive", store.root)
        assert message.count("lot-") == 5, message
        assert "and 55 more" in message
    for command in ("list", "audit", "verify", "discover", "release", "station log", "archive query SELECT/**/1"):
        refused("holds no archive, one with runs is needed", *command.split(), "--archive", tmp_path / "none")
    refused("so that no queue is watched", "station", "monitor", "--queue", "line-1", "--archive", store.root)
