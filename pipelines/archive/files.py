"""Single files of the archive: durable, atomic writing; reading that trusts nothing.

Everything is written under a temporary name in the folder where it will live, fsynced, then renamed: a reader sees the
whole file or none. Equal tables give equal bytes, whatever the host and the hour.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import uuid
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Generator

    import pandas as pd

TABLE_MARK = b"tumbleline.table"
SCHEMA_MARK = b"tumbleline.schema"
TEMPORARY = ".tmp-"


IN_ARCHIVE = "give another with --archive DIR or TUMBLELINE_ARCHIVE"
ELSEWHERE = "name another place"


@contextmanager
def writing(path: Path, what: str = "archive", remedy: str = IN_ARCHIVE) -> Generator[None, None, None]:
    """A block that writes under ``path``; what the system refuses becomes one message.

    Parameters
    ----------
    what : is written, as the message begins.
    remedy : what the reader can do, as it ends.
    """
    try:
        yield
    except OSError as problem:
        message = (
            f"{what}: {path} cannot be written ({problem.strerror}), a folder with write permission and free space is "
            f"needed; {remedy}"
        )
        raise ArchiveUnusable(message) from None


def sha256(path: Path) -> str:
    """Hash of a file's bytes, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def table_bytes(name: str, frame: pd.DataFrame, version: int) -> bytes:
    """A table as Parquet: zstd, no index, no library notes, the table's name and schema version in the metadata."""
    table = pa.Table.from_pandas(frame, preserve_index=False)
    table = table.replace_schema_metadata({TABLE_MARK: name.encode(), SCHEMA_MARK: str(version).encode()})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", compression_level=3)
    return sink.getvalue().to_pybytes()


def read_table(path: Path, name: str, expected: str | None = None) -> pd.DataFrame:
    """A table of the archive, checked to be whole, ours and unchanged since it was written.

    Parameters
    ----------
    expected : hash that the manifest gives; None where there is no manifest to compare with.
    """
    remedy = "restore it from a copy, or remove the run's folder and run it again"
    if not path.is_file():
        message = (
            f"archive: {path} is not there, table '{name}' is needed; if the run was stopped, give its command again "
            "and it goes on"
        )
        raise ArchiveUnusable(message)
    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as problem:
        reason = str(problem).splitlines()[0]
        message = f"archive: {path} ({path.stat().st_size} bytes) is not a whole Parquet file ({reason}); {remedy}"
        raise ArchiveUnusable(message) from None
    mark = (table.schema.metadata or {}).get(TABLE_MARK, b"").decode()
    if mark != name:
        found = f"holds table '{mark}'" if mark else "was not written by this archive"
        message = f"archive: {path} {found}, table '{name}' is needed; import foreign files with 'tumbleline import'"
        raise ArchiveUnusable(message)
    if expected is not None and sha256(path) != expected:
        message = f"archive: {path} has changed since it was written (its hash is not its manifest's); {remedy}"
        raise ArchiveUnusable(message)
    return table.to_pandas()


def read_json(path: Path) -> dict[str, Any]:
    """A manifest's content."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        message = f"archive: {path} is not a manifest that can be read; restore it from a copy"
        raise ArchiveUnusable(message) from None


def json_bytes(content: dict[str, Any]) -> bytes:
    """Canonical JSON: keys sorted, UTF-8, one newline at the end."""
    return (json.dumps(content, sort_keys=True, indent=1, ensure_ascii=False) + "\n").encode()


def publish(path: Path, data: bytes, what: str = "archive", remedy: str = IN_ARCHIVE) -> None:
    """Write a file so that it is there whole or not at all, and stays there after a power cut.

    Parameters
    ----------
    what, remedy : beginning and end of the message where it cannot be written.
    """
    with writing(path.parent, what, remedy):
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.parent / f"{TEMPORARY}{uuid.uuid4().hex}"
        try:
            _write_durably(aside, data)
            aside.replace(path)
            _sync_folder(path.parent)
        finally:
            aside.unlink(missing_ok=True)


def publish_folder(path: Path, files: dict[str, bytes]) -> None:
    """Write several files so that they are there together or not at all; a folder that is there already stays."""
    with writing(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        aside = path.parent / f"{TEMPORARY}{uuid.uuid4().hex}"
        aside.mkdir()
        try:
            for name, data in files.items():
                _write_durably(aside / name, data)
            _sync_folder(aside)
            if not path.exists():
                aside.rename(path)
            _sync_folder(path.parent)
        finally:
            shutil.rmtree(aside, ignore_errors=True)


def sweep(folder: Path) -> None:
    """Remove what a killed writer left under temporary names; only for folders with one writer."""
    if folder.is_dir():
        with writing(folder):
            for left in folder.glob(f"{TEMPORARY}*"):
                shutil.rmtree(left) if left.is_dir() else left.unlink()


def _write_durably(path: Path, data: bytes) -> None:
    with path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
