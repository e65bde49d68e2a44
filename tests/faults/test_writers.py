"""Several writers at once, killed ones, killed compactions: nothing is lost, nobody reads half of anything, debris goes."""

import os
import shutil
import signal
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import pytest
from capture_double import CaptureDouble, measured_run, small_job, small_run
from ledger_events import day, event
from packed_archive import certified_archive, later, logical, packed_zips, single
from typer.testing import CliRunner

from pipelines.archive import Archive, files, hash_chain, packs, parquet
from pipelines.archive.cleaning import clean
from pipelines.archive.compaction import compact
from pipelines.archive.locks import alone
from pipelines.certificates import Ledger
from pipelines.chain.certify import certify
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.integrity import verify
from schemas.errors import ArchiveUnusable

WRITERS = 8
MANIFESTS = ("runs/*/*.json", "captures/*/[0-9]*/record.json", "calibrations/*/*/[0-9]*.json", "chain/*/[0-9]*.json")


def write(folder: Path, root: Path, number: int) -> None:
    """A lot of its own, then the one that all of the writers work on."""
    archive = Archive(root)
    folder.mkdir()
    for seed in (number, 99):
        job = small_job(folder, ("seed = 5", f"seed = {seed}"), ('"A1", "A2", "A3"', f'"S{seed}", "T{seed}"'))
        run = measured_run(job, archive, CaptureDouble())
        run.seal()
        certify(Ledger(archive), run, start=day(number), until=day(300), supersede=True)


def halves(root: Path) -> list[str]:
    """What a look at every table and manifest finds broken."""
    found = list[str]()
    for path in root.glob("runs/*/*.parquet"):
        try:
            parquet.read_table(path, path.stem)
        except ArchiveUnusable as problem:
            found.append(str(problem))
    for pattern in MANIFESTS:
        for path in root.glob(pattern):
            files.read_json(path)
    return found


@pytest.mark.slow
def test_eight_writers_at_once_lose_nothing_and_nobody_reads_half(tmp_path: Path, monkeypatch) -> None:
    """Eight processes: each a lot and its certificates of its own, and all of them one more lot, at the same time."""
    monkeypatch.setenv("TUMBLELINE_SIGNING_KEY", "")
    root, numbers = tmp_path / "archive", range(1, WRITERS + 1)
    archive, ledger = Archive(root), Ledger(root)
    archive.prepare()
    job = small_job(tmp_path, ("seed = 5", "seed = 99"), ('"A1", "A2", "A3"', '"S99", "T99"'))
    shared = archive.capture(job.capture_id)
    CaptureDouble()(job, shared, lambda *_: None)
    shared.complete()
    with ProcessPoolExecutor(WRITERS, get_context("spawn")) as writers:
        written = [writers.submit(write, tmp_path / f"w{n}", root, n) for n in numbers]
        while not all(one.done() for one in written):
            assert halves(root) == []
            time.sleep(0.02)
        assert [one.exception() for one in written] == [None] * WRITERS
    assert len(archive.runs()) == WRITERS + 1
    assert all(ledger.valid_at(f"S{n}", day(100)) is not None for n in numbers)
    events = ledger.events("S99")
    assert [e.sequence for e in events] == [*numbers]
    assert {e.start for e in events} == {day(n) for n in numbers}
    assert verify(archive, keys={}).checked.findings == []
    assert hash_chain.last_number(root) >= 3 * WRITERS
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


# -- compaction -----------------------------------------------------------------------------------------------------------


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    return certified_archive(tmp_path / "archive")


def reading(root: Path, names: list[str], ready: Any, stop: Any) -> None:
    """Reads files of an archive again and again."""
    place = Archive(root).root
    expected = {name: (place / name).read_bytes() for name in names}
    ready.set()
    while not stop.is_set():
        assert all((place / name).read_bytes() == data for name, data in expected.items())
        assert all((place / name).is_file() for name in names)


@pytest.mark.slow
def test_a_reader_finds_every_file_while_packs_are_merged(archive: Archive) -> None:
    compact(archive)
    run = archive.run("latest").id
    names = [name for name in logical(archive) if name.startswith((f"runs/{run}/", "calibrations/"))]
    spawn = get_context("spawn")
    ready, stop, merged = spawn.Event(), spawn.Event(), 0
    reader = spawn.Process(target=reading, args=(Path(str(archive.root)), names, ready, stop), daemon=True)
    reader.start()
    assert ready.wait(60.0)
    for count in range(12):
        later(archive, f"runs/{run}/more/{count}.json", bytes(200_000 * (1 + count)))
        before = len(packed_zips(archive))
        compact(archive)
        merged += len(packed_zips(archive)) <= before
    stop.set()
    reader.join(60.0)
    assert reader.exitcode == 0
    assert merged > 5


def compacting(root: Path, left: int, *, opens: bool) -> None:
    """A compaction that kills itself behind so many changes of the disk, and openings of packs."""

    def counted(event: str, arguments: tuple) -> None:
        nonlocal left
        writes = event in {"os.rename", "os.remove", "os.rmdir", "os.truncate"}
        if writes or (event == "open" and "packed" in str(arguments[0]) and opens):
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    sys.addaudithook(counted)
    compact(Archive(root))


def killed_and_again(archive: Archive, root: Path, step: int, *, opens: bool) -> int | None:
    """The status of a compaction of a copy; every file is there, after it and after another one."""
    expected = logical(archive)
    shutil.copytree(str(archive.root), root)
    process = get_context("spawn").Process(target=compacting, args=(root, step), kwargs={"opens": opens}, daemon=True)
    process.start()
    process.join(120.0)
    assert logical(Archive(root)) == expected
    compact(Archive(root))
    assert logical(Archive(root)) == expected
    return process.exitcode


@pytest.mark.slow
def test_killed_at_any_step_leaves_every_file(archive: Archive, tmp_path: Path) -> None:
    for step in (1, 5, 7, 20, 150):  # before a zip, before its contents, between the packs, among the removals
        root = tmp_path / f"archive-{step}"
        assert killed_and_again(archive, root, step, opens=True) == -signal.SIGKILL
        assert len(single(Archive(root))) < len(logical(archive)) // 10


@pytest.mark.slow
def test_killed_while_merging_leaves_every_file(archive: Archive, tmp_path: Path) -> None:
    compact(archive)
    run = archive.run("latest").id
    size = (archive.root / packs.FOLDER / packed_zips(archive)[0]).stat().st_size
    later(archive, f"runs/{run}/more.json", bytes(size))
    for step in range(0, 60, 2):
        root = tmp_path / f"archive-{step}"
        status = killed_and_again(archive, root, step, opens=False)
        assert len(list((root / packs.FOLDER).iterdir())) == 5  # a pack of the month, one of the ledger, and the lock
        if status == 0:
            break
        assert status == -signal.SIGKILL
    assert step > 6
    assert status == 0
