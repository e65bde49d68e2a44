"""Compaction: packed files read like single ones, for every reader; open runs refuse it."""

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from capture_double import small_run
from packed_archive import certified_archive, later, logical, packed_zips, single

from pipelines.archive import Archive, files, packs
from pipelines.archive.backup import copy_archive
from pipelines.archive.compaction import compact
from pipelines.archive.locks import alone
from pipelines.archive.pack_writing import FolderToPack, due_of, merge_packs, write_pack
from pipelines.audit.index import up_to_date
from pipelines.audit.sql import ask
from pipelines.certificates.ledger import Ledger
from pipelines.integrity.archive import verify
from schemas.errors import ArchiveUnusable, OperatorNeeded


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    return certified_archive(tmp_path / "archive")


def test_every_reader_sees_the_same_files(archive: Archive) -> None:
    before, run = logical(archive), archive.run("latest")
    tables = {name: run.table(name) for name in run.tables()}
    serials = [unit["serial"] for unit in run.about["lot"]["units"]]
    listed, events = archive.runs(), [Ledger(archive).events(serial) for serial in serials]
    count = len(single(archive))
    done = compact(archive)
    assert done.packed == done.freed > 100
    assert not done.kept
    assert len(single(archive)) < count // 10
    again = Archive(str(archive.root))
    assert logical(again) == before
    assert again.runs() == listed
    by_path, by_text = (list(again.root.glob(one)) for one in (Path("runs/*/run.json"), "runs/*/run.json"))
    assert by_path == by_text  # as rglob of Python 3.13
    assert [Ledger(again).events(serial) for serial in serials] == events
    assert all(events)
    run = again.run("latest")
    assert all(run.table(name).equals(table) for name, table in tables.items())
    assert len(run.table("samples"))
    report = verify(again, keys={})
    assert report.whole, report.checked.findings


def test_index_and_queries_are_as_before(archive: Archive) -> None:
    question = "SELECT count(*), sum(value) FROM coefficients"
    first = up_to_date(archive)
    expected = ask(archive, question, compact=False).rows
    compact(archive)
    second = up_to_date(archive)
    assert (second.made, second.kept) == (0, first.made)  # stamps are those of the single files
    assert ask(archive, question, compact=False).rows == expected
    shutil.rmtree(archive.root / "index")
    assert up_to_date(archive).made == first.made
    assert ask(archive, question).rows == expected


def test_open_and_unfinished_runs_are_left_alone(archive: Archive) -> None:
    run, before = archive.run("latest"), logical(archive)
    with alone(run.path), pytest.raises(OperatorNeeded, match="without open runs is needed"):
        compact(archive)
    assert not (archive.root / packs.FOLDER / "000001-calibrations.zip").exists()
    assert logical(archive) == before
    (run.path / "sealed.json").unlink()
    assert compact(archive).unfinished == [run.id]
    assert (Path(str(run.path)) / "run.json").stat().st_size


def test_a_finished_command_finds_its_packed_run_and_the_next_event_follows_the_packed_ones(archive: Archive) -> None:
    compact(archive)
    before = single(archive)
    again = small_run(Path(str(archive.root)).parent)
    assert again.id == archive.run("latest").id
    assert {p.suffix for p in set(single(archive)) - set(before)} <= {".html", ".json"}
    compact(archive)
    serial = archive.run("latest").about["lot"]["units"][0]["serial"]
    ledger = Ledger(archive)
    assert [event.action for event in ledger.events(serial)] == ["certify"]
    ledger.revoke(serial, "dropped")
    assert [event.sequence for event in ledger.events(serial)] == [1, 2]
    assert not compact(archive).kept
    place = next((ledger.root / "calibrations").glob("*/*/000001.json"))
    assert not files.publish_first(place, b"another")


def test_a_copy_of_a_compacted_archive_and_its_unpacked_zips_are_the_single_files(
    archive: Archive, tmp_path: Path
) -> None:
    expected = logical(archive)
    compact(archive)
    copy = Archive(tmp_path / "copy")
    copy_archive(archive, copy)
    assert logical(copy) == expected
    assert not (copy.root / packs.FOLDER).exists()
    compact(copy)
    assert copy_archive(archive, copy).files == 0
    for path in Path(str(archive.root / packs.FOLDER)).glob("*.zip"):
        with zipfile.ZipFile(path) as container:
            container.extractall(archive.root)
    shutil.rmtree(archive.root / packs.FOLDER)
    assert logical(Archive(str(archive.root))) == expected


def flip(path: Path) -> int:
    """Changes a bit in the middle of a file; its size."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    return len(data)


@pytest.mark.parametrize(("suffix", "damage"), [("zip", flip), ("zip", Path.unlink), ("toc", flip)])
def test_damage_is_found(archive: Archive, suffix: str, damage: Callable[[Path], object]) -> None:
    compact(archive)
    damage(min(Path(str(archive.root / packs.FOLDER)).glob(f"*.{suffix}")))
    try:
        report = verify(Archive(str(archive.root)), keys={})
    except ArchiveUnusable:
        return
    assert not report.whole
    assert any(packs.FOLDER in finding.path for finding in report.checked.findings)


def test_every_folder_is_where_its_table_says_however_many_are_asked_for(tmp_path: Path) -> None:
    top = tmp_path / packs.FOLDER
    top.mkdir()
    names = [f'runs/line-{k}"é' for k in range(3 * packs.SEARCHED)]
    for number, own in enumerate((names[::2], names[1::2], names[:2]), 1):
        lines = [packs.line_of(name, number, {"run.json": (100 * number, 7, number)}) for name in own]
        (top / f"{number:06d}-2026-01.zip").write_bytes(b"zip")
        (top / f"{number:06d}-2026-01.toc").write_bytes(b"{}\n{}\n" + b"".join(lines))
    known = packs.Packs(tmp_path)
    for name in names * 2:
        number = 3 if name in names[:2] else 1 + names.index(name) % 2
        folder = known.folder(name)
        assert folder.files["run.json"][1:] == (100 * number, 7, number)
    assert known.folder("runs/line-1") is None


def test_many_compactions_leave_few_packs() -> None:
    sizes: list[int] = []
    for _ in range(40):
        sizes.append(50_000)
        due = due_of(sizes)
        sizes[-due:] = [sum(sizes[-due:])]
        assert len(sizes) <= 10
    assert len(sizes) < 8


def test_merging_keeps_the_newer_of_two_files_wherever_it_is_packed(archive: Archive) -> None:
    compact(archive)
    root = Path(str(archive.root))
    month = next(name[7:-4] for name in packed_zips(archive) if "calibrations" not in name)
    folder = f"runs/{archive.run('latest').id}"

    for stamp, (what, note) in enumerate(((month, b"1"), ("2099-12", b"2"), (month, b"third"), ("2099-12", b"4")), 1):
        data = {"note.json": note, f"{stamp}.json": b"y" * 10**6}
        packed = {name: (len(own), stamp) for name, own in data.items()}
        write_pack(root, what, [FolderToPack(folder, 1, packed)], lambda _, name, data=data: data[name])
    merged = merge_packs(root)
    assert sorted(len(own) for own in merged.values()) == [2, 3]
    assert (Archive(str(root)).root / folder / "note.json").read_bytes() == b"4"
    assert {f"{k}.json" for k in range(1, 5)} <= {p.name for p in (archive.root / folder).iterdir()}
    assert (archive.root / folder / "run.json").is_file()


def test_a_damaged_pack_is_not_merged(archive: Archive) -> None:
    compact(archive)
    run = archive.run("latest").id
    name = next(one for one in packed_zips(archive) if "calibrations" not in one)
    place = Path(str(archive.root / packs.FOLDER / name))
    large = bytes(flip(place))
    later(archive, f"runs/{run}/large.json", large)
    with pytest.raises(ArchiveUnusable, match=r"has changed since it was made; restore it from a copy"):
        compact(archive)
    assert place.is_file()
    assert (archive.root / "runs" / run / "large.json").read_bytes() == large
