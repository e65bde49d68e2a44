"""Several writers at once, and killed ones: nothing is lost, nobody reads half of anything, debris is taken away."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from capture_double import CaptureDouble, small_job, small_run
from ledger_events import day, event
from root_process import ROOT
from typer.testing import CliRunner

from pipelines.archive import Archive, files, hash_chain, parquet
from pipelines.archive.cleaning import clean
from pipelines.archive.locks import alone
from pipelines.certificates import Ledger
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.integrity import verify
from schemas.errors import ArchiveUnusable

TESTS = ROOT / "tests"
WRITERS = 8
MANIFESTS = ("runs/*/*.json", "captures/*/[0-9]*/record.json", "calibrations/*/*/[0-9]*.json", "chain/*/[0-9]*.json")

WRITER = """
import sys
from pathlib import Path
sys.path[:0] = [{tests!r}, {root!r}]
from capture_double import CaptureDouble, small_job
from ledger_events import day
from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify

folder, archive, number = Path(sys.argv[1]), Archive(sys.argv[2]), int(sys.argv[3])
folder.mkdir()
for seed in (number, 99):  # a lot of its own, then the one that all of them work on
    job = small_job(folder, ("seed = 5", f"seed = {{seed}}"), ('"A1", "A2", "A3"', f'"S{{seed}}", "T{{seed}}"'))
    runner = Runner(job, archive, measure=CaptureDouble())
    for stage in ORDER[:-1]:
        runner.stage(stage)
    runner.run.seal()
    certify(Ledger(archive), runner.run, start=day(number), until=day(300), supersede=True)
"""

FLOOD = """
import sys
sys.path[:0] = [{tests!r}, {root!r}]
from pathlib import Path
from pipelines.archive import files
folder, data, n = Path(sys.argv[1]), b"x" * 2_000_000, 0
print("ready", flush=True)
while True:
    files.publish(folder / f"{{n % 7}}.bin", data)
    files.publish_folder(folder / f"record-{{n}}", {{"a": data[:1000], "b": data[:1000]}})
    n += 1
"""


def start(text: str, *arguments: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", text.format(tests=str(TESTS), root=str(ROOT)), *map(str, arguments)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "TUMBLELINE_SIGNING_KEY": ""}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.mark.slow
def test_eight_writers_at_once_lose_nothing_and_nobody_reads_half(tmp_path: Path) -> None:
    """Eight processes: each a lot and its certificates of its own, and all of them one more lot, at the same time."""
    root = tmp_path / "archive"
    Archive(root).prepare()
    job = small_job(tmp_path, ("seed = 5", "seed = 99"), ('"A1", "A2", "A3"', '"S99", "T99"'))
    shared = Archive(root).capture(job.capture_id)
    CaptureDouble()(job, shared, lambda *_: None)
    shared.complete()
    writers = [start(WRITER, tmp_path / f"w{n}", root, n) for n in range(1, WRITERS + 1)]
    halves, looks, over = list[str](), 0, threading.Event()

    def look() -> None:
        nonlocal looks
        while not over.is_set():
            for path in root.glob("runs/*/*.parquet"):
                try:
                    parquet.read_table(path, path.stem)
                except ArchiveUnusable as problem:
                    halves.append(str(problem))
                looks += 1
            for pattern in MANIFESTS:
                for path in root.glob(pattern):
                    files.read_json(path)
            time.sleep(0.02)

    reader = threading.Thread(target=look)
    reader.start()
    errors = [writer.communicate(timeout=240)[1] for writer in writers]
    over.set()
    reader.join()
    assert [writer.returncode for writer in writers] == [0] * WRITERS, errors
    assert halves == []
    assert looks > 0
    archive = Archive(root)
    assert len(archive.runs()) == WRITERS + 1
    ledger = Ledger(archive)
    for n in range(1, WRITERS + 1):
        assert ledger.valid_at(f"S{n}", day(100)) is not None
    events = ledger.events("S99")
    assert [e.sequence for e in events] == list(range(1, WRITERS + 1))
    assert {e.start for e in events} == {day(n) for n in range(1, WRITERS + 1)}
    report = verify(archive, keys={})
    assert report.checked.findings == []
    assert hash_chain.last_number(root) >= 3 * WRITERS
    assert not list(root.rglob(f"{files.TEMPORARY}*"))


@pytest.mark.slow
def test_a_writer_killed_in_a_publish_leaves_only_what_clean_takes_away(tmp_path: Path) -> None:
    root = tmp_path / "archive"
    Archive(root).prepare()
    folder = root / "runs" / "r-1"
    folder.mkdir(parents=True)
    left: list[Path] = []
    for _ in range(20):
        writer = start(FLOOD, folder)
        assert writer.stdout.readline() == "ready\n"
        end = time.monotonic() + 20.0
        while not list(folder.glob(f"{files.TEMPORARY}*")) and time.monotonic() < end:
            pass
        writer.send_signal(signal.SIGKILL)
        writer.communicate()
        left = list(root.rglob(f"{files.TEMPORARY}*"))
        if left:
            break
    assert left, "no kill met a publish"
    assert {path.stat().st_size for path in folder.glob("*.bin")} <= {2_000_000}
    assert all(len(list(path.iterdir())) == 2 for path in folder.glob("record-*"))
    looked = clean(Archive(root), only_look=True)
    assert sorted(looked.removed) == sorted(map(str, left))
    assert list(root.rglob(f"{files.TEMPORARY}*"))
    done = clean(Archive(root))
    assert sorted(done.removed) == sorted(map(str, left))
    assert not list(root.rglob(f"{files.TEMPORARY}*"))


def test_clean_takes_nothing_that_is_being_written_or_measured_now(tmp_path: Path) -> None:
    Archive(tmp_path).prepare()
    folder, capture = tmp_path / "chain" / "000000", tmp_path / "captures" / "c"
    folder.mkdir(parents=True)
    with files._aside(folder) as aside:
        aside.write_bytes(b"half")
        done = clean(Archive(tmp_path))
        assert (done.removed, done.busy) == ([], [str(folder)])
        assert aside.read_bytes() == b"half"
    with alone(capture):
        (capture / f"{files.TEMPORARY}ahead-00003").mkdir()
        assert clean(Archive(tmp_path)).removed == []
    left = [folder / f"{files.TEMPORARY}dead", capture / f"{files.TEMPORARY}ahead-00003"]
    left[0].write_bytes(b"12345")
    for words, removed in (("found", ["--dry-run"]), ("removed", [])):
        told = CliRunner().invoke(app, ["archive", "clean", *removed, "--archive", str(tmp_path)])
        assert f"2 leftovers of killed writers {words} (5 bytes)" in told.stdout
        assert told.exit_code == 0
    assert not any(path.exists() for path in left)


def test_what_a_killed_writer_left_out_of_the_chain_is_sealed_by_a_run_finished_again_and_by_clean(
    tmp_path: Path,
) -> None:
    run, job = small_run(tmp_path), small_job(tmp_path)
    mark, nothing = run.path / "sealed.json", CaptureDouble(stop_after=0)
    list(Runner(job, run.archive, measure=nothing).all())
    mark.unlink()
    assert all(done.reused for done in Runner(job, run.archive, measure=nothing).all())
    assert mark.is_file()
    mark.unlink()
    Ledger(run.archive).add(event())
    done = clean(run.archive)
    assert (done.sealed, done.anchored) == ([run.id], 1)
    again = clean(run.archive)
    assert (again.sealed, again.anchored) == ([], 0)
