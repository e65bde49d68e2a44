"""Single files of the archive: durable and atomic writing, reading with checks.

On a disk a file is written under a temporary name in its folder, synchronised, then renamed; in an object store a put is atomic.
A reader sees the whole file or none.
"""

import hashlib
import json
import os
import shutil
import uuid
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipelines.archive.names import LinkInArchive, refuse_leading_out
from pipelines.archive.signatures import signed
from pipelines.archive.store import ObjectPath, Place, first_line
from schemas import host
from schemas.errors import ArchiveUnusable

TEMPORARY = ".tmp-"
WAITING = 8  # files written at the same time

IN_ARCHIVE = (
    "give this user the right to write and make room, or name a copy ('tumbleline archive backup') or another archive with "
    "--archive DIR or TUMBLELINE_ARCHIVE"
)
ELSEWHERE = "name another place"


@contextmanager
def writing(path: Place, what: str = "archive", remedy: str = IN_ARCHIVE) -> Generator[None, None, None]:
    """A block that writes below ``path``; an error of the system becomes one message.

    what : what is written; the message begins with it.
    remedy : what the user can do; the message ends with it.
    """
    try:
        yield
    except OSError as problem:
        raise ArchiveUnusable(
            f"{what}: {path} cannot be written ({first_line(problem)}), a folder with write permission and free space is "
            f"needed; {remedy}"
        ) from None


def sha256(path: Place) -> str:
    """Hash of a file's bytes, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()  # pyright: ignore[reportArgumentType]  # bytes in memory, too


def hash_of(data: bytes) -> str:
    """Hash of bytes, hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def read_json(path: Place) -> dict[str, Any]:
    """A manifest's content."""
    try:
        data = path.read_bytes()
    except LinkInArchive:
        raise
    except OSError:
        data = b""  # no manifest
    return parsed(data, path)


def parsed(data: bytes, path: Place) -> dict[str, Any]:
    """The content of a manifest from its bytes; refused where it names a file outside the archive."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise ArchiveUnusable(f"archive: {path} is not a manifest that can be read; restore it from a copy")
    refuse_leading_out(content, path)
    return content


def json_bytes(content: Mapping[str, Any]) -> bytes:
    """Canonical JSON: keys sorted, UTF-8, one newline at the end."""
    return (json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False) + "\n").encode()


def manifest_bytes(content: Mapping[str, Any]) -> bytes:
    """The bytes of a manifest, signed where a key is configured."""
    return json_bytes(signed(content))


def publish(path: Place, data: bytes, what: str = "archive", remedy: str = IN_ARCHIVE) -> None:
    """Write a file completely or not at all, so that it survives a power failure.

    what, remedy : beginning and end of the error message.
    """
    with writing(path, what, remedy):
        # a pipe or a device is written to, not replaced by a file
        if isinstance(path, ObjectPath) or (path.exists() and not path.is_file() and not path.is_dir()):
            path.write_bytes(data)
            return
        with _aside(path.parent) as aside:
            _write_durably(aside, data)
            aside.replace(path)
            _sync_folder(path.parent)


def publish_all(folder: Path | ObjectPath, contents: Mapping[str, bytes]) -> None:
    """Write several files of a folder in order, each completely or not at all; faster than one by one.

    All are on the disk before the first one gets its name.
    """
    with writing(folder):
        if isinstance(folder, ObjectPath):
            for name, data in contents.items():
                (folder / name).write_bytes(data)
            return
        from concurrent.futures import ThreadPoolExecutor  # slow to import, and few commands need it

        with _aside(folder) as aside:
            aside.mkdir()
            # threads that synchronise together share one commit of the file system: a tenth of the time of one by one
            with ThreadPoolExecutor(WAITING) as threads:
                list(threads.map(lambda name: _write_durably(aside / name, contents[name]), contents))
            for name in contents:
                (aside / name).replace(folder / name)
            _sync_folder(folder)


def publish_first(path: Place, data: bytes) -> bool:
    """Write a file if it does not exist; true if this call wrote it.

    Of several processes exactly one gets true. An object store has no such operation: its callers hold a claim.
    """
    with writing(path.parent):
        if path.is_file():  # also one that is packed
            return False
        if isinstance(path, ObjectPath):
            path.write_bytes(data)
            return True
        with _aside(path.parent) as aside:
            _write_durably(aside, data)
            try:
                os.link(aside, path)
            except FileExistsError:
                return False
            _sync_folder(path.parent)
            return True


def ahead(path: Place) -> Place:
    """The temporary folder for files that :func:`publish_folder` publishes later with the rest."""
    return path if isinstance(path, ObjectPath) else path.parent / f"{TEMPORARY}ahead-{path.name}"


def publish_folder(path: Place, files: Mapping[str, bytes]) -> None:
    """Write several files together or not at all; an existing folder stays as it is.

    In an object store the last file of the mapping is put last; it must be the file that shows readers that all are complete.
    Files that were written :func:`ahead` are published with them.
    """
    with writing(path.parent):
        if isinstance(path, ObjectPath):
            for name, data in files.items():
                (path / name).write_bytes(data)
            return
        begun = path.parent / f"{TEMPORARY}ahead-{path.name}"
        with _aside(path.parent) as aside:
            if begun.is_dir():
                begun.rename(aside)
            else:
                aside.mkdir()
            for name, data in files.items():
                _write_durably(aside / name, data)
            _sync_folder(aside)
            if not path.exists():
                aside.rename(path)
            _sync_folder(path.parent)


def drop(folder: Place) -> None:
    """Remove the files that were written :func:`ahead`."""
    with writing(folder.parent):
        if isinstance(folder, ObjectPath):
            for path in folder.walk():
                path.unlink()
        elif folder.is_dir():
            shutil.rmtree(folder)


def sweep(folder: Place) -> None:
    """Remove temporary files of a killed writer, unless another process writes to the folder now."""
    if isinstance(folder, ObjectPath) or not folder.is_dir():  # an object store has no temporary names
        return
    with writing(folder), writers_of(folder, host.EXCLUSIVE | host.AT_ONCE) as mine:
        for left in folder.glob(f"{TEMPORARY}*") if mine else ():
            shutil.rmtree(left) if left.is_dir() else left.unlink()


@contextmanager
def _aside(folder: Path) -> Generator[Path, None, None]:
    """A temporary name in a folder for writing before publishing; it is removed in any case."""
    folder.mkdir(parents=True, exist_ok=True)
    aside = folder / f"{TEMPORARY}{uuid.uuid4().hex}"
    with writers_of(folder, host.SHARED):
        try:
            yield aside
        finally:
            if aside.is_dir():
                shutil.rmtree(aside, ignore_errors=True)
            else:
                aside.unlink(missing_ok=True)


@contextmanager
def writers_of(folder: Path, mode: int) -> Generator[bool, None, None]:
    """A block with a lock on a folder: shared among writers, exclusive for cleaning.

    The system releases the lock when a process dies. Yields whether the lock was granted; a file system
    without locks grants none.

    mode : ``host.SHARED``, or ``host.EXCLUSIVE | host.AT_ONCE``.
    """
    with host.opened_folder(folder) as handle:
        try:
            if handle is not None:
                host.lock(handle, mode)
            given = handle is not None
        except OSError:  # another process holds it, or the file system has no locks
            given = False
        yield given


def _write_durably(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(path: Path) -> None:
    with host.opened_folder(path) as handle:
        if handle is not None:
            os.fsync(handle)
