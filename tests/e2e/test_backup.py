"""Backup and restore: an archive that grows, copies that are torn or of another archive, and the database of a server."""

import shutil
import sqlite3
import stat
import threading
from contextlib import closing
from pathlib import Path

import pytest
from capture_double import BRIEF, CaptureDouble, finished_run, small_job
from each import each
from in_process import document_of, given, text_of

from pipelines.archive import Archive, backup
from pipelines.archive.backup import copy_archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.integrity.archive import verify
from pipelines.orchestrator.database import copy_database, restore_database
from schemas.errors import ArchiveUnusable, WrongUse


def measure(folder: Path, seed: int, stop: str = "") -> Runner:
    """A run of another lot in the archive of a folder, up to a stage or complete."""
    runner = Runner(small_job(folder, *BRIEF, seed=seed), Archive(folder / "archive"), measure=CaptureDouble())
    for stage in ORDER[: ORDER.index(stop)] if stop else ORDER[:-1]:
        runner.stage(stage)
    if not stop:
        runner.run.save_report("key", "<html></html>", {})
    return runner


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an archive of one finished run and one that was interrupted."""
    folder = tmp_path_factory.mktemp("backup")
    measure(folder, 1)
    measure(folder, 2, "fit")
    return folder


@pytest.fixture
def line(made: Path, tmp_path: Path) -> tuple[Archive, Archive]:
    """A copy of that archive, to be written to, and the place of its backup."""
    shutil.copytree(made, tmp_path / "line")
    return Archive(tmp_path / "line" / "archive"), Archive(tmp_path / "copy")


def content(root: Path) -> dict[str, bytes]:
    files = {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}
    return {name: data for name, data in files.items() if not name.startswith("index/")}


def test_a_copy_restored_is_the_archive_byte_for_byte(made: Path, tmp_path: Path) -> None:
    root, copy, back = made / "archive", tmp_path / "copy", tmp_path / "back"
    text_of("archive", "backup", copy, "--archive", root, status=0)
    assert "nothing is wrong" in text_of("archive", "restore", copy, "--archive", back, status=0)
    assert document_of("archive", "restore", copy, "--archive", tmp_path / "more")["whole"]
    assert content(back) == content(root)
    assert verify(Archive(back), keys={}).head == verify(Archive(root), keys={}).head


@pytest.mark.slow
def test_a_further_copy_adds_what_is_new_and_a_continued_run_is_complete_in_it(line, tmp_path: Path) -> None:
    archive, copy = line
    first = copy_archive(archive, copy)
    assert copy_archive(archive, copy).files == 0
    measure(tmp_path / "line", 2)  # goes on with the run that was interrupted
    again = copy_archive(archive, copy)
    assert 0 < again.files < first.files
    assert content(copy.root) == content(archive.root)
    assert verify(copy, keys={}).whole


def test_a_copy_that_was_torn_is_completed_and_is_sound_at_any_point(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive, copy = Archive(made / "archive"), Archive(tmp_path / "copy")
    publish, left = backup.files.publish, [0]

    def full(path: Path, data: bytes) -> None:
        if left[0] == 0:
            raise ArchiveUnusable("archive: disk full")
        left[0] -= 1
        publish(path, data)

    number = len(content(archive.root))
    for step in (number // 3, number // 3, 2):
        left[0] = step
        with monkeypatch.context() as patch:
            patch.setattr(backup.files, "publish", full)
            with pytest.raises(ArchiveUnusable, match="disk full"):
                copy_archive(archive, copy)
        named = {
            place for entry in (copy.root / "chain").rglob("*.json") for place in backup.files.read_json(entry)["files"]
        }
        assert [place for place in named if not (copy.root / place).is_file()] == []
    copy_archive(archive, copy)
    assert content(copy.root) == content(archive.root)


@pytest.mark.slow
def test_a_copy_during_which_a_run_ends_is_sound(line, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    archive, copy = line
    names, listed = backup._names, list[str]()

    def ends_after_the_chain_is_listed(folder: Path, prefix: str, *links: list[str]) -> set[str]:
        if not prefix and not listed:
            listed.append("files")
            measure(tmp_path / "line", 2)  # the interrupted run is completed and sealed
        return names(folder, prefix, *links)

    monkeypatch.setattr(backup, "_names", ends_after_the_chain_is_listed)
    copy_archive(archive, copy)
    assert {one.kind for one in verify(copy, keys={}).checked.findings} <= {"unsealed"}
    copy_archive(archive, copy)
    assert content(copy.root) == content(archive.root)
    assert verify(copy, keys={}).whole


def test_an_older_copy_restored_leaves_the_checkpoint_of_records_measured_since(line) -> None:
    archive, copy = line
    copy_archive(archive, copy)
    capture = next(path for path in (archive.root / "captures").iterdir() if path.is_dir())
    newest = max(path for path in capture.iterdir() if (path / "record.json").is_file())
    shutil.copytree(newest, capture / f"{int(newest.name) + 1:05d}")  # measured after the backup
    state = capture / "state" / f"{int(newest.name) + 1:05d}.bin"
    state.parent.mkdir(exist_ok=True)
    state.write_bytes(b"checkpoint")
    copy_archive(copy, archive)
    assert state.is_file()


@pytest.mark.slow
def test_a_copy_of_another_archive_or_into_itself_is_refused(made: Path, tmp_path: Path) -> None:
    archive = Archive(made / "archive")
    finished_run(tmp_path, *BRIEF)
    with pytest.raises(ArchiveUnusable, match=r"a chain that .* does not have, an earlier copy"):
        copy_archive(archive, Archive(tmp_path / "archive"))
    with pytest.raises(WrongUse, match="lies in the archive"):
        copy_archive(archive, Archive(made / "archive" / "copy"))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").touch()
    with pytest.raises(ArchiveUnusable, match="holds other files and no archive"):
        copy_archive(archive, Archive(tmp_path / "other"))
    with pytest.raises(ArchiveUnusable, match="holds no archive"):
        copy_archive(Archive(tmp_path / "none"), Archive(tmp_path / "copy"))


def database(path: Path, rows: int) -> None:
    """A database in SQLite's write-ahead mode, as that of a server, with its last rows in the log only."""
    with closing(sqlite3.connect(path)) as made_database:
        made_database.execute("pragma journal_mode=wal")
        made_database.execute("create table if not exists flow_run (id integer)")
        made_database.executemany("insert into flow_run values (?)", [(k,) for k in range(rows)])
        made_database.commit()


def rows_of(path: Path) -> int:
    with closing(sqlite3.connect(path)) as opened:
        return int(opened.execute("select count(*) from flow_run").fetchone()[0])


def test_the_database_of_a_server_is_copied_while_it_is_open_and_restored_when_it_is_not(tmp_path: Path) -> None:
    live, copy = tmp_path / "prefect.db", tmp_path / "copies" / "one.db"
    database(live, 100)
    with closing(sqlite3.connect(live)) as server:  # holds the log open, and writes on
        server.execute("insert into flow_run values (1)")
        server.commit()
        copy_database(str(live), copy)
        server.execute("insert into flow_run values (7)")
        server.commit()
        with pytest.raises(WrongUse, match="is in use"):
            restore_database(copy, str(live))
        assert server.execute("select count(*) from flow_run").fetchone()[0] == 102
    assert rows_of(copy) == 101
    assert stat.S_IMODE(copy.stat().st_mode) == 0o600
    restore_database(copy, str(live))
    assert rows_of(live) == 101
    assert stat.S_IMODE(live.stat().st_mode) == 0o600


def test_a_damaged_copy_of_a_database_is_refused_and_the_database_kept(tmp_path: Path) -> None:
    live, torn = tmp_path / "prefect.db", tmp_path / "torn.db"
    database(live, 5)
    torn.write_bytes(b"SQLite format 3\0" + b"\xff" * 5000)
    for wrong, told in ((torn, "no sound database"), (tmp_path / "none", "is not there")):
        with pytest.raises(WrongUse, match=told):
            restore_database(wrong, str(live))
    assert rows_of(live) == 5
    with pytest.raises(WrongUse, match="exists, a new file is needed"):
        copy_database(str(live), torn)


def test_the_command_keeps_the_newest_copies_of_the_database_and_a_refused_restore_leaves_it(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PREFECT_HOME", str(tmp_path))
    monkeypatch.delenv("PREFECT_SERVER_DATABASE_CONNECTION_URL", raising=False)
    server, copies = tmp_path / "prefect.db", tmp_path / "copies"
    database(server, 3)
    copies.mkdir()
    for day in range(1, 6):
        (copies / f"orchestrator-2026010{day}T000000.db").touch()
    words = ("archive", "backup", tmp_path / "copy", "--archive", made / "archive", "--database", copies)
    text_of(*words, "--keep", "2", status=0)
    kept = sorted(path.name for path in copies.iterdir())
    assert kept[0] == "orchestrator-20260105T000000.db"
    assert rows_of(copies / kept[1]) == rows_of(server)
    database(tmp_path / "old.db", 1)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").touch()
    words = ("archive", "restore", made / "archive", "--archive", tmp_path / "other")
    assert given(*words, "--database", tmp_path / "old.db")[0] != 0
    assert rows_of(server) == 3


SPOILT = {
    "runs/*/coefficients.json": ("short",),
    "runs/*/coefficients.parquet": ("short",),
    "captures/*/*/samples.parquet": ("short", "torn"),
    "captures/*/*/record.json": ("empty",),
    "captures/*/complete.json": ("torn",),
}


@each([(pattern, how) for pattern, kinds in SPOILT.items() for how in kinds], " ".join)
def test_a_damaged_file_does_not_replace_the_sound_one_of_the_copy_nor_stay_in_it(
    case: tuple[str, str], made: Path, tmp_path: Path
) -> None:
    pattern, how = case
    shutil.copytree(made, tmp_path / "line")
    archive, copy = Archive(tmp_path / "line" / "archive"), Archive(tmp_path / "copy")
    copy_archive(archive, copy)
    damaged = min((tmp_path / "line" / "archive").glob(pattern))
    there = tmp_path / "copy" / damaged.relative_to(tmp_path / "line" / "archive")
    sound = damaged.read_bytes()
    wrong = {"short": sound[:-1], "empty": b"", "torn": sound[:10] + bytes(20) + sound[10:]}[how]
    damaged.write_bytes(wrong)
    with pytest.raises(ArchiveUnusable, match=rf"1 files of .* damaged .*{damaged.name}"):
        copy_archive(archive, copy)
    assert there.read_bytes() == sound
    assert verify(copy, keys={}).whole
    damaged.write_bytes(sound)
    assert copy_archive(archive, copy).files == 0
    if damaged.suffix == ".parquet":  # and the other way round: a damaged file of the copy is mended from the sound one
        there.write_bytes(wrong)
        assert copy_archive(archive, copy).files == 1
        assert there.read_bytes() == sound


def test_the_seal_of_an_entry_that_is_written_while_the_files_are_listed_is_copied(line, tmp_path: Path) -> None:
    archive, copy = line
    (seal, *_) = sorted((archive.root / "runs").glob("*/sealed.json"))
    seal.rename(tmp_path / "sealed.json")
    later = threading.Timer(0.3, lambda: shutil.move(tmp_path / "sealed.json", seal))
    later.start()
    copy_archive(archive, copy)
    later.join()
    assert verify(copy, keys={}).whole
