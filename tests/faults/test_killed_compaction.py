"""A compaction that is killed loses nothing, and a reader beside it finds every file."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from packed_archive import certified_archive, later, logical, packed_zips, single

from pipelines.archive import Archive, packs
from pipelines.archive.compaction import compact


@pytest.fixture
def archive(tmp_path: Path) -> Archive:
    return certified_archive(tmp_path / "archive")


READING = """
import sys
from pathlib import Path
from pipelines.archive import Archive
root = Archive(sys.argv[1]).root
names = sys.stdin.readline().split()
expected = {name: (root / name).read_bytes() for name in names}
print("ready", flush=True)
rounds = 0
while not (Path(sys.argv[1]) / "stop").exists() or not rounds:
    assert all((root / name).read_bytes() == data for name, data in expected.items())
    assert all((root / name).is_file() for name in names)
    rounds += 1
print(rounds)
"""


@pytest.mark.slow
def test_a_reader_finds_every_file_while_packs_are_merged(archive: Archive) -> None:
    compact(archive)
    run = archive.run("latest").id
    names = [name for name in logical(archive) if name.startswith((f"runs/{run}/", "calibrations/"))]
    words = [sys.executable, "-c", READING, str(archive.root)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as reader:
        assert reader.stdin
        assert reader.stdout
        reader.stdin.write(" ".join(names) + "\n")
        reader.stdin.flush()
        assert reader.stdout.readline() == "ready\n"
        merged = 0
        for count in range(12):
            later(archive, f"runs/{run}/more/{count}.json", bytes(200_000 * (1 + count)))
            before = len(packed_zips(archive))
            compact(archive)
            merged += len(packed_zips(archive)) <= before
        (Path(str(archive.root)) / "stop").touch()
        assert int(reader.stdout.read()) > 1
    assert reader.returncode == 0
    assert merged > 5


KILLED = """
import os, signal, sys
from pathlib import Path
from pipelines.archive import Archive, compaction
left = int(sys.argv[2])
def counted(event, arguments):
    global left
    writes = event in {"os.rename", "os.remove", "os.rmdir", "os.truncate"}
    if writes or (event == "open" and "packed" in str(arguments[0]) and sys.argv[3] == "opens"):
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(counted)
compaction.compact(Archive(sys.argv[1]))
"""


@pytest.mark.slow
def test_killed_at_any_step_leaves_every_file(archive: Archive, tmp_path: Path) -> None:
    expected = logical(archive)
    killed = 0
    for step in (1, 5, 7, 20, 150):  # before a zip, before its contents, between the packs, among the removals
        root = tmp_path / f"archive-{step}"
        shutil.copytree(str(archive.root), root)
        ended = subprocess.run([sys.executable, "-c", KILLED, str(root), str(step), "opens"], check=False)
        killed += ended.returncode == -signal.SIGKILL
        assert logical(Archive(str(root))) == expected
        compact(Archive(str(root)))
        assert logical(Archive(str(root))) == expected
        assert len(single(Archive(str(root)))) < len(expected) // 10
        shutil.rmtree(root)
    assert killed == 5


@pytest.mark.slow
def test_killed_while_merging_leaves_every_file(archive: Archive, tmp_path: Path) -> None:
    compact(archive)
    run = archive.run("latest").id
    size = (archive.root / packs.FOLDER / packed_zips(archive)[0]).stat().st_size
    later(archive, f"runs/{run}/more.json", bytes(size))
    expected, killed, ended_well = logical(archive), 0, 0
    for step in range(0, 60, 2):
        root = tmp_path / f"archive-{step}"
        shutil.copytree(Path(str(archive.root)), root)
        ended = subprocess.run([sys.executable, "-c", KILLED, str(root), str(step), "writes"], check=False)
        killed += ended.returncode == -signal.SIGKILL
        ended_well += ended.returncode == 0
        assert logical(Archive(str(root))) == expected
        compact(Archive(str(root)))
        assert logical(Archive(str(root))) == expected
        assert len(list((root / packs.FOLDER).iterdir())) == 5  # a pack of the month, one of the ledger, and the lock
        shutil.rmtree(root)
        if ended_well:
            break
    assert killed > 3
    assert ended_well == 1
