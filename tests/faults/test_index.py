"""The audit's index in trouble: readers while others write, a writer that is killed, parts that are foreign or incomplete."""

import os
import shutil
import signal
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive, files
from pipelines.archive.cleaning import clean
from pipelines.audit import index
from pipelines.audit.index import AuditIndex, up_to_date
from pipelines.audit.run_rows import TABLES
from schemas.errors import ArchiveUnusable


def reads(root: Path) -> None:
    """Reads the index again and again: whole runs, none twice, none lost."""
    index.RUNS_PER_PART, index.MOST_SMALL = 2, 1
    seen = 0
    while not (root / "end").exists():
        found = up_to_date(Archive(root))
        runs = found.table("runs").column("run").to_pylist()
        assert len(runs) == len(set(runs)) >= seen
        for name in ("units", "parameters", "figures", "coefficients"):
            assert set(found.table(name).column("run").to_pylist()) == set(runs), name
        seen = len(runs)


def is_killed(root: Path) -> None:
    """An index is made and its process killed: the first part is written, the second one is not."""
    write, written = files._write_durably, list[Path]()

    def fatal(path: Path, data: bytes) -> None:
        write(path, data)
        written.extend([path] if "figures" in path.name else [])
        if len(written) == 2:
            os.kill(os.getpid(), signal.SIGKILL)

    index.RUNS_PER_PART, files._write_durably = 2, fatal
    up_to_date(Archive(root))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory") / "archive"
    write_archive(folder, 12, years=1.0, seed=5, workers=1)
    return folder


@pytest.fixture
def archive(made: Path, tmp_path: Path) -> Archive:
    shutil.copytree(made, tmp_path / "archive", ignore=shutil.ignore_patterns("index"))
    return Archive(tmp_path / "archive")


def rows(audit_index: AuditIndex) -> dict[str, list]:
    """All rows of an index, without what only tells how it came to be."""
    tables = {name: audit_index.table(name) for name in TABLES}
    tables["runs"] = tables["runs"].drop_columns(["stamp"])
    return {name: sorted(map(repr, table.to_pylist())) for name, table in tables.items()}


def start(function: Callable[[Path], None], root: Path) -> SpawnProcess:
    process = get_context("spawn").Process(target=function, args=(root,), daemon=True)
    process.start()
    return process


@pytest.mark.slow
def test_readers_see_whole_runs_while_runs_come_and_parts_are_put_together(made: Path, tmp_path: Path) -> None:
    root = tmp_path / "archive"
    (root / "runs").mkdir(parents=True)
    shutil.copy2(made / "archive.json", root)
    runs = sorted((made / "runs").iterdir())
    shutil.copytree(runs[0], root / "runs" / runs[0].name)
    readers = [start(reads, root) for _ in range(3)]
    for run in runs[1:]:
        time.sleep(0.2)
        begun = root / f"{run.name}.begun"
        shutil.copytree(run, begun)
        begun.rename(root / "runs" / run.name)
    time.sleep(1.0)
    (root / "end").touch()
    for reader in readers:
        reader.join(120)
    assert [reader.exitcode for reader in readers] == [0, 0, 0]
    assert rows(up_to_date(Archive(root))) == rows(up_to_date(Archive(made)))


def test_a_part_that_somebody_reads_is_not_taken_away(archive: Archive, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(index, "RUNS_PER_PART", 4)
    monkeypatch.setattr(index, "MOST_SMALL", 0)
    reading = up_to_date(archive)
    before = rows(reading)
    run = min((archive.root / "runs").iterdir())
    os.utime(run / "run.json", ns=(1, 1))  # its part is made again
    assert up_to_date(archive).made == 4
    assert rows(reading) == before
    parts = len(list((archive.root / "index").glob("*/runs.parquet")))
    del reading
    assert up_to_date(archive).made == 0
    assert len(list((archive.root / "index").glob("*/runs.parquet"))) < parts


@pytest.mark.slow
def test_a_kill_in_the_middle_leaves_an_index_that_is_gone_on_with(archive: Archive, made: Path) -> None:
    killed = start(is_killed, archive.root)
    killed.join(120)
    assert killed.exitcode == -signal.SIGKILL
    audit_index = up_to_date(archive)
    assert (audit_index.kept, audit_index.made) == (2, 10)
    assert rows(audit_index) == rows(up_to_date(Archive(made)))
    del audit_index
    [left] = (archive.root / "index").glob(".tmp-*")
    assert clean(archive).removed == [str(left)]


def test_a_part_without_one_of_its_tables_is_made_again_and_foreign_files_are_passed_over(
    archive: Archive, made: Path
) -> None:
    whole = rows(up_to_date(Archive(made)))
    part = up_to_date(archive).parts[0]
    (part / "figures.parquet").unlink()
    shutil.copytree(part, part.parent / "0123456789abcdef")
    audit_index = up_to_date(archive)
    assert audit_index.made == 12
    assert rows(audit_index) == whole
    del audit_index
    foreign = archive.root / "index" / "fedcba9876543210"
    foreign.mkdir()
    for name in TABLES:
        pq.write_table(pa.table({"a": [1]}), foreign / f"{name}.parquet")
    (archive.root / "index" / "note.txt").write_text("mine", encoding="utf-8")
    audit_index = up_to_date(archive)
    assert rows(audit_index) == whole
    place = audit_index.parts[0] / "figures.parquet"
    place.write_bytes(place.read_bytes()[:1000])  # one that is cut off is told with what to do
    with pytest.raises(ArchiveUnusable, match=r"index .* cannot be read .*; remove .*, it is made again"):
        audit_index.table("figures")


def test_a_foreign_table_a_newer_one_and_a_manifest_that_is_none_leave_out_their_runs_alone(archive: Archive) -> None:
    foreign, newer, broken, cut, *_ = sorted((archive.root / "runs").iterdir())
    pq.write_table(pa.table({"unit": ["A"]}), foreign / "grades.parquet")
    (foreign / "grades.json").unlink()
    table = pq.read_table(newer / "figures.parquet")
    marks = {**table.schema.metadata, b"tumbleline.schema": b"99"}
    pq.write_table(table.replace_schema_metadata(marks), newer / "figures.parquet")
    manifest = files.read_json(newer / "figures.json")
    manifest["sha256"] = files.sha256(newer / "figures.parquet")
    (newer / "figures.json").write_bytes(files.json_bytes(manifest))
    (broken / "run.json").write_text("[]", encoding="utf-8")
    (cut / "residuals.json").unlink()
    lines = up_to_date(archive).table("runs", ["run", "problem"]).to_pylist()
    told = {line["run"]: line["problem"] for line in lines if line["problem"]}
    assert "has schema 99, this version knows up to" in told.pop(newer.name)
    assert told == {
        foreign.name: "grades.parquet has no manifest",
        broken.name: "run.json is no manifest",
        cut.name: "residuals.parquet has no manifest",
    }
