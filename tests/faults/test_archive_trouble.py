"""Trouble with the archive: each is one clear message, nothing is lost, and the same command goes on afterwards."""

import json
import os
import resource
import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pandas as pd
import pytest
from capture_double import CaptureDouble, recipe_file, small_job

from pipelines.archive import Archive, Run, hash_chain, provenance
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify
from pipelines.chain.runner import Runner
from pipelines.cli import main
from pipelines.integrity import verify
from pipelines.jobs.job import Request
from schemas.errors import WrongUse

ROOT = Path(__file__).resolve().parents[2]
MORE = "bias,scale,misalignment,bias_temperature,scale_temperature,second_order"


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("finished")
    list(Runner(small_job(folder), Archive(folder / "archive"), measure=CaptureDouble()).all())
    return folder / "archive"


@pytest.fixture
def root(finished: Path, tmp_path: Path) -> Path:
    shutil.copytree(finished, tmp_path / "archive")
    return tmp_path / "archive"


def told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: object
) -> tuple[int, str, str]:
    monkeypatch.setattr("sys.argv", ["tumbleline", *map(str, arguments)])
    with pytest.raises(SystemExit) as left:
        main()
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return int(left.value.code or 0), out, err


def tables(run: Run) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(run.path.glob("*.parquet"))}


def limited(size: int, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A command in a process that can write no file beyond a size: what it meets is a disk that is full."""

    def full() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.RLIM_INFINITY))

    return subprocess.run(
        [sys.executable, "-m", "pipelines.cli", *map(str, arguments)],
        capture_output=True, text=True, check=False, cwd=ROOT, preexec_fn=full,
        env={**os.environ, "OMP_NUM_THREADS": "1", "TUMBLELINE_SIGNING_KEY": ""},
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("command", ["rerun", "fit"])
def test_a_disk_that_fills_in_the_middle_of_a_rerun_loses_nothing(root: Path, command: str) -> None:
    old = Archive(root).run("latest")
    before = tables(old)
    arguments = [command, old.id, "--effects", MORE, "--archive", root]
    stopped = limited(9_000, *arguments)
    expected = 2 if command == "fit" else 1  # a re-run tells of each run, and goes on
    assert stopped.returncode == expected, stopped.stderr
    assert "cannot be written (File too large)" in " ".join((stopped.stdout + stopped.stderr).split())
    assert "Traceback" not in stopped.stderr
    assert tables(old) == before
    report = verify(Archive(root), keys={})
    assert report.checked.findings == []
    # the files of the new run are published together, or not at all
    assert [info.id for info in Archive(root).runs()] == [old.id]
    assert limited(10**9, *arguments).returncode in {0, 1}
    [new] = [info.id for info in Archive(root).runs() if info.id != old.id]
    assert set(tables(Archive(root).run(new))) >= set(before)
    assert tables(old) == before
    assert verify(Archive(root), keys={}).whole
    assert not list(root.rglob(".tmp-*"))


@pytest.mark.parametrize(
    "place", ["runs/{run}/mine.parquet", "runs/mine.parquet", "captures/{capture}/00001/mine.parquet", "mine.parquet"]
)
def test_a_foreign_table_anywhere_is_told_by_name_and_disturbs_nothing(
    root: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    run = Archive(root).run("latest")
    path = root / place.format(run=run.id, capture=run.about["capture"])
    pd.DataFrame({"a": [1]}).to_parquet(path)
    status, out, _ = told(monkeypatch, capsys, "verify", "--archive", root)
    assert status == 1
    assert "foreign" in out
    assert "mine.parquet" in out
    assert "import foreign files with 'tumbleline import'" in out
    assert told(monkeypatch, capsys, "list", "--json", "--archive", root)[0] == 0
    status, _, err = told(monkeypatch, capsys, "show", "latest", "mine", "--archive", root)
    assert status == 2
    assert "no table is called 'mine'" in err


def test_a_foreign_table_under_a_tables_name_is_told(root: Path, monkeypatch, capsys) -> None:
    run = Archive(root).run("latest")
    pd.DataFrame({"a": [1]}).to_parquet(run.path / "grades.parquet")
    status, _, err = told(monkeypatch, capsys, "show", "latest", "grades", "--archive", root)
    assert status == 2
    assert "was not written by this archive, table 'grades' is needed" in err


@pytest.mark.parametrize("command", [("list",), ("show", "latest"), ("show", "small"), ("verify",), ("lineage", "A1")])
def test_an_archive_of_a_newer_format_is_told_by_every_command(root: Path, monkeypatch, capsys, command) -> None:
    (root / "archive.json").write_text('{"format": 9, "product": "tumbleline"}\n')
    status, _, err = told(monkeypatch, capsys, *command, "--archive", root)
    assert status == 2
    assert "has format 9, this version writes 1; use the version that wrote it" in err


@pytest.mark.parametrize("command", [("show", "latest", "dwells"), ("export", "latest"), ("report", "latest")])
def test_a_manifest_of_a_newer_schema_is_told(root: Path, monkeypatch, capsys, command) -> None:
    manifest = Archive(root).run("latest").path / "dwells.json"
    manifest.write_text(manifest.read_text().replace('"schema": 1', '"schema": 8'))
    status, _, err = told(monkeypatch, capsys, *command, "--archive", root)
    assert status == 2
    assert "dwells.json has schema 8, this version knows up to" in err


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


@pytest.mark.parametrize("day", ["0001-01-01T00:00:00+02:00", "9999-12-31T23:00:00-05:00", "2026-13-01", "tomorrow"])
def test_a_day_that_no_calendar_has_is_told(root: Path, monkeypatch, capsys, day: str) -> None:
    status, _, err = told(monkeypatch, capsys, "show", "A1", "--at", day, "--archive", root)
    assert status == 2
    assert "a date such as 2026-05-01 is needed" in err


@pytest.mark.parametrize(
    "serial", ["../../etc/passwd", "a/b", "A\n1", "A\\1", "\x1b[31mred", "A" * 65, "..", "\u0410\u0031", "A1\u200b"]
)
def test_a_serial_that_could_be_a_path_or_a_line_is_refused_by_a_run(
    tmp_path: Path, monkeypatch, capsys, serial: str
) -> None:
    status, _, err = told(monkeypatch, capsys, "run", "--direct", "--units", serial, "--archive", tmp_path / "a")
    assert status == 2
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("serial", ["../../etc/passwd", "a/b", "A\n1", "\x1b[31mred"])
@pytest.mark.parametrize("way", ["column", "option"])
def test_a_serial_that_could_be_a_path_or_a_line_is_refused_by_an_import(
    tmp_path: Path, monkeypatch, capsys, serial: str, way: str
) -> None:
    frame = pd.DataFrame({"sn": [serial] * 200, "t": [0.01 * n for n in range(200)], "x": 0.0, "y": 0.0, "z": 1.0})
    frame.to_csv(tmp_path / "record.csv", index=False)
    unit = ",unit=sn" if way == "column" else ""
    option = [] if way == "column" else ["--unit", serial]
    command = [
        "import",
        tmp_path / "record.csv",
        "--map",
        f"time=t,x=x,y=y,z=z{unit}",
        "--units",
        "output=g,time=s",
        *option,
    ]
    status, _, err = told(monkeypatch, capsys, *command, "--archive", tmp_path / "a")
    assert status == 2
    assert len(err.strip().splitlines()) == 1
    assert "is not usable, 1 to 64 of the letters A to Z, digits" in err
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("serial", ["../../etc/passwd", "A\n1"])
def test_a_strange_serial_is_looked_up_without_leaving_the_archive(
    root: Path, monkeypatch, capsys, serial: str
) -> None:
    status, _, err = told(monkeypatch, capsys, "show", serial, "--at", "2026-01-01", "--archive", root)
    assert status == 2
    assert repr(serial) in err
    assert len(err.strip().splitlines()) == 1


def test_two_units_with_one_serial_in_one_lot_are_refused(tmp_path: Path, monkeypatch, capsys) -> None:
    status, _, err = told(monkeypatch, capsys, "run", "--direct", "--units", "A1,B2,A1", "--archive", tmp_path / "a")
    assert status == 2
    assert "serial A1 is there twice" in err


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


@pytest.mark.slow
def test_two_measurements_one_after_the_other_are_both_certified(tmp_path: Path) -> None:
    store = Archive(tmp_path / "archive")
    for seed in (5, 6):
        runner = Runner(small_job(tmp_path, ("seed = 5", f"seed = {seed}")), store, measure=CaptureDouble())
        list(runner.all())
        certify(Ledger(store), runner.run)
    assert [e.action for e in Ledger(store).events("A1")] == ["certify", "supersede"]


@pytest.mark.parametrize(("days", "refused"), [(-1, True), pytest.param(400, False, marks=pytest.mark.slow)])
def test_what_was_measured_with_an_overdue_standard_is_not_certified(
    tmp_path: Path, days: int, *, refused: bool
) -> None:
    due = (datetime.now(UTC) + timedelta(days=days)).date()
    station = tmp_path / "bench.toml"
    own = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")
    station.write_text(f'{own}\n[[reference]]\nid = "L-7"\ncertificate = "C 12"\ndue = {due}\n', encoding="utf-8")
    job = Request(recipe=recipe_file(tmp_path), station=station).job()
    runner = Runner(job, Archive(tmp_path / "archive"), measure=CaptureDouble())
    list(runner.all())
    ledger = Ledger(runner.run.archive)
    if refused:
        with pytest.raises(WrongUse, match=rf"reference standard L-7 \(certificate C 12\) was due on {due}"):
            certify(ledger, runner.run)
    else:
        certify(ledger, runner.run)


def test_a_run_that_was_cut_off_tells_how_to_go_on_everywhere(root: Path, monkeypatch, capsys) -> None:
    run = Archive(root).run("latest")
    for name in ("grades", "figures", "report", "sealed"):
        for path in run.path.glob(f"{name}.*"):
            path.unlink()
    assert "to continue" in told(monkeypatch, capsys, "show", "latest", "--archive", root)[1]
    for command in (("certify", "latest"), ("report", "latest")):
        status, _, err = told(monkeypatch, capsys, *command, "--archive", root)
        assert status == 2
        assert "not finished" in err


def test_a_run_json_that_was_lost_hides_no_other_run(root: Path, monkeypatch, capsys) -> None:
    (root / "runs" / "empty").mkdir()
    (root / "runs" / "lost").mkdir()
    (root / "runs" / "lost" / "dwells.json").write_text("{}", encoding="utf-8")
    status, out, _ = told(monkeypatch, capsys, "list", "--json", "--archive", root)
    assert status == 0
    assert len(json.loads(out)["runs"]) == 1
    status, out, _ = told(monkeypatch, capsys, "verify", "--json", "--archive", root)
    told_of = json.loads(out)
    assert [(f["kind"], f["path"]) for f in told_of["findings"]] == [("missing", "runs/lost/run.json")]
    assert told_of["remarks"] == ["runs/empty holds no run: its writer was killed, or has just started"]
