"""No command writes a file of the user in place: a write that fails leaves the file that was there."""

import errno
import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from each import each

from pipelines.archive import files
from pipelines.cli.export import _write as write_export
from schemas.errors import ArchiveUnusable

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("pipelines", "tumbleline", "stations", "schemas", "inertial")
BY_ITSELF = {
    "pipelines/archive/files.py": "it is the one writer",
    "pipelines/archive/pack_writing.py": "a pack gets its name when it is whole",
    "pipelines/archive/archive.py": "an empty probe whether the archive can be written",
    "pipelines/archive/locks.py": "empty claims, told by their names",
    "pipelines/archive/signatures.py": "a private key is a new file from the start, which nobody else may read",
    "pipelines/cli/unexpected.py": "a report of a defect, in the state folder",
    "pipelines/doctor/check.py": "a probe, which is removed",
    "pipelines/flows/local.py": "locks and the address of a server",
    "pipelines/importers/readers/dataflash.py": "a temporary copy for a library that reads paths",
    "pipelines/importers/readers/rosbag.py": "a temporary copy for a library that reads paths",
    "pipelines/importers/readers/rosbag2.py": "a temporary copy for a library that reads paths",
    "pipelines/importers/readers/uff58.py": "a temporary copy for a library that reads paths",
    "pipelines/importers/readers/wearable.py": "a temporary copy for a library that reads paths",
    "pipelines/orchestrator/server.py": "lock and log of the server",
    "pipelines/orchestrator/worker.py": "a lock",
    "pipelines/workbench/routes/upload.py": "an upload, which gets its name when it is whole",
    "pipelines/workbench/services/lots.py": "log of a lot, and answers that are new files",
    "stations/links/recorder.py": "frames as they come, in a new file",
    "stations/opening.py": "a lock",
    "stations/plant/equipment.py": "results of simulated equipment, in a temporary folder",
    "stations/safety/folder.py": "a log",
    "stations/safety/lease_files.py": "notes of leases have a writer of their own, below the archive",
    "stations/safety/leases.py": "a lock",
    "stations/safety/watchdog_client.py": "a log",
    "stations/self_test.py": "a history to which lines are added",
    "tumbleline/recordings.py": "a table in the folder of a session, named by its content",
}
"""Modules that write files in another way, and why that loses nothing of a user."""

WRITES = re.compile(
    r"""\.write_(?:text|bytes)\(|\bopen\([^()\n]*["'][wax]b?\+?["']|O_CREAT|\bh5py\.File\((?!sink)[^()\n]*["'][wax]"""
    r"""|(?:\.to_(?:csv|parquet|excel|json)|savemat|np\.savez?|TdmsWriter)\((?!sink|buffer|\)|\w+=)"""
)
"""Calls that write where their first argument is a path; bytes are made in a ``sink`` or ``buffer``."""


def written_by_itself() -> Iterator[str]:
    """Modules of the product with a call that writes a file."""
    for path in sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        if WRITES.search(path.read_text("utf-8")):
            yield path.relative_to(ROOT).as_posix()


@each([
    ("path.write_text(text)", True), ("open(path, 'w')", True), ("path.open('ab')", True), ("path.open()", False),
    ("frame.to_csv(path)", True), ("frame.to_csv(index=False)", False), ("frame.to_parquet(sink)", False),
    ("savemat(path, {})", True), ("np.save(folder / name, x)", True), ("h5py.File(path, 'w')", True),
    ("os.open(path, os.O_WRONLY | os.O_CREAT)", True), ("run.save(stage, key)", False),
])  # fmt: skip
def test_a_call_that_writes_is_seen(row: tuple[str, bool]) -> None:
    assert bool(WRITES.search(row[0])) is row[1]


def test_files_of_users_are_written_by_the_one_helper() -> None:
    assert sorted(BY_ITSELF) == list(written_by_itself())


@pytest.fixture
def full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on a disk of 64 KiB with a file ``out``, and no room left; where nothing may be mounted, writes fail half way."""
    place = tmp_path / "full"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    mounted = os.geteuid() == 0 and subprocess.run(command, capture_output=True, check=False).returncode == 0
    (place / "out").write_bytes(b"earlier")
    if mounted:
        with pytest.raises(OSError, match="space"):
            (place / "filler").write_bytes(bytes(2**20))
    else:

        def half(path: Path, data: bytes) -> None:
            path.write_bytes(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))

        monkeypatch.setattr(files, "_write_durably", half)
    try:
        yield place
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(place)], check=True)


def test_a_full_disk_keeps_the_earlier_file_and_is_told_with_its_name(full: Path) -> None:
    with pytest.raises(ArchiveUnusable, match=r"full/out cannot be written .*space"):
        write_export({"a.c": bytes(10**5)}, full / "out")
    assert (full / "out").read_bytes() == b"earlier"
    assert not list(full.glob(".tmp-*"))


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        files.publish(pipe, b"text")
        assert os.read(reader, 10) == b"text"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
