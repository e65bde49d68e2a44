"""The index of the events of all units, so that a hundred thousand small files are read only once.

``index/ledger/<digit>.noted`` has the events of units whose folder name begins with this digit, after a line with its seal. It is
derived from the files of the ledger and can be removed at any time; an indexed event is used while its file has the same size and
time.
"""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa

from pipelines.archive import derived, files
from pipelines.archive.packed_path import PackedPath
from pipelines.archive.store import ObjectPath, Place, first_line
from pipelines.certificates.entries import FOLDER, LedgerEntry, event_of, folder_of
from schemas.errors import ArchiveUnusable

INDEX_FOLDER = "index/ledger"
VERSION = b"tumbleline.ledger 1"
DIGITS = "0123456789abcdef"
FEWEST_NEW = 8  # reading fewer files again is faster than writing the index
READERS = 8
AT_ONCE = 64  # files for one task of a thread
NAMES = tuple(field.name for field in fields(LedgerEntry))


class IndexedEvent(NamedTuple):
    """An event, with size and time of its file."""

    stamp: str
    event: LedgerEntry


@dataclass
class Histories:
    """The events of every intact unit, in order, and the fault of every other one, by folder.

    read : number of files that were read instead of taken from the index
    """

    units: list[list[LedgerEntry]] = field(default_factory=list[list[LedgerEntry]])
    problems: dict[str, str] = field(default_factory=dict[str, str])
    read: int = 0


def histories_of(root: Place) -> Histories:
    """The events of all units of an archive, from the index where it is up to date."""
    histories = Histories()
    stamps = stamps_of(root / FOLDER)
    for digit in DIGITS:
        stamps_of_digit = stamps.get(digit, {})
        if stamps_of_digit:
            _gather(histories, root, _events(histories, root, digit, stamps_of_digit))
    return histories


def _events(histories: Histories, root: Place, digit: str, stamps: Mapping[str, str]) -> dict[str, LedgerEntry | str]:
    """Events by the paths of their files, or the fault of a file; new events are added to the index."""
    path = root / INDEX_FOLDER / f"{digit}.noted"
    before, state = indexed_events(path)
    if state == derived.EDITED:
        derived.warn_of_edits(path)
    known = {name: entry for name, entry in before.items() if stamps.get(name) == entry.stamp}
    missing = [name for name in stamps if name not in known]
    read = all_read(root / FOLDER, missing)
    histories.read += len(read)
    new = {name: IndexedEvent(stamps[name], event) for name, event in read.items() if isinstance(event, LedgerEntry)}
    if len(new) + len(before) - len(known) >= FEWEST_NEW or state == derived.EDITED:
        with suppress(ArchiveUnusable):  # a reader without write permission does without the index
            files.publish(path, derived.framed(_encoded(known | new)))
    return {name: known[name].event if name in known else read[name] for name in stamps}


def _gather(histories: Histories, root: Place, events: Mapping[str, LedgerEntry | str]) -> None:
    """Collect the events of every unit; a unit with a missing, foreign or unreadable event is added to ``problems``."""
    by_unit: dict[str, list[str]] = {}
    for name in sorted(events):
        by_unit.setdefault(name.rpartition("/")[0], []).append(name)
    for folder, names in by_unit.items():
        history: list[LedgerEntry] = []
        for count, name in enumerate(names, 1):
            event = events[name]
            wrong = event if isinstance(event, str) else _wrong(event, folder, count, name)
            if wrong or isinstance(event, str):
                histories.problems[str(root / FOLDER / folder)] = wrong
                break
            history.append(event)
        else:
            histories.units.append(history)


def _wrong(event: LedgerEntry, folder: str, count: int, name: str) -> str:
    if event.sequence != count or not name.endswith(f"/{count:06d}.json"):
        return (
            f"has event {name.rpartition('/')[2]} where number {count} is needed; restore the missing file from a copy"
        )
    if folder_of(event.serial) != f"{FOLDER}/{folder}":
        return f"has unit {event.serial!r}, which belongs into another folder; restore it from a copy"
    return ""


def all_read(top: Place, names: Sequence[str]) -> dict[str, LedgerEntry | str]:
    """The events of files below a folder, by name, or their faults; read by threads, because disks serve requests in parallel."""
    groups = [names[k : k + AT_ONCE] for k in range(0, len(names), AT_ONCE)]
    out: dict[str, LedgerEntry | str] = {}
    with ThreadPoolExecutor(READERS) as pool:
        for group, events in zip(
            groups, pool.map(lambda part: [_read(top, name) for name in part], groups), strict=True
        ):
            out |= zip(group, events, strict=True)
    return out


def _read(top: Place, name: str) -> LedgerEntry | str:
    """The event of a file, or the fault of the file."""
    try:
        if isinstance(top, ObjectPath):
            data = (top / name).read_bytes()
        else:
            try:
                with open(f"{top}/{name}", "rb", buffering=0) as file:  # noqa: PTH123 - a hundred thousand of these
                    data = file.readall()
            except FileNotFoundError:  # packed
                data = (top / name).read_bytes()
        return event_of(files.parsed(data, top / name), f"{top}/{name}")
    except ArchiveUnusable as problem:
        return str(problem).partition(": ")[2]
    except OSError as problem:
        return f"cannot be read ({first_line(problem)}); restore it from a copy"


def indexed_events(path: Place) -> tuple[dict[str, IndexedEvent], str]:
    """The indexed events by the path of their file, and the state of the index's seal; no events unless the seal is intact."""
    import pyarrow.parquet as pq

    try:
        data, state = derived.unframed(path)
    except (OSError, ArchiveUnusable):  # the index does not exist, or cannot be read
        return {}, derived.SOUND
    if state != derived.SOUND:
        return {}, state
    try:
        table = pq.ParquetFile(pa.BufferReader(data)).read(use_threads=False)
        if (table.schema.metadata or {}).get(VERSION) is None:
            return {}, state
        columns = {name: table.column(name).to_pylist() for name in ("place", "stamp", *NAMES)}
    except (pa.ArrowInvalid, KeyError):  # of another version
        return {}, state
    for name in ("ends", "evidence"):  # many are equal
        known = {text: _tuples(json.loads(text)) for text in set(columns[name])}
        columns[name] = [known[text] for text in columns[name]]
    events = (LedgerEntry(*row) for row in zip(*(columns[name] for name in NAMES), strict=True))
    rows = zip(columns["place"], columns["stamp"], events, strict=True)
    return {name: IndexedEvent(stamp, event) for name, stamp, event in rows}, state


def _tuples(value: Any) -> Any:
    """Lists as tuples, at any depth."""
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


def _encoded(known: Mapping[str, IndexedEvent]) -> bytes:
    import pyarrow.parquet as pq

    order = sorted(known)
    columns: dict[str, pa.Array] = {
        "place": pa.array(order, pa.string()),
        "stamp": pa.array([known[name].stamp for name in order], pa.string()),
    }
    for name in NAMES:
        values = [getattr(known[file].event, name) for file in order]
        if name == "sequence":
            columns[name] = pa.array(values, pa.int64())
        else:
            texts = values if name not in {"ends", "evidence"} else [json.dumps(value) for value in values]
            columns[name] = pa.array(map(str, texts), pa.string())
    table = pa.table(columns).replace_schema_metadata({VERSION: b""})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", compression_level=1)
    return sink.getvalue().to_pybytes()


def stamps_of(top: Place) -> dict[str, dict[str, str]]:
    """Size and time of every event's file: by the first digit of its folder, by its path below ``calibrations``."""
    out: dict[str, dict[str, str]] = {}
    if isinstance(top, ObjectPath):
        for info in _objects(top):
            out.setdefault(info[0][0], {})[info[0]] = info[1]
        return out
    if not top.is_dir():
        return {}
    shards = [name for name in sorted(os.listdir(top)) if name[0] in DIGITS]  # noqa: PTH208 - names are enough
    with ThreadPoolExecutor(READERS) as pool:
        for name, stamps in zip(shards, pool.map(lambda shard: _of_shard(top, shard), shards), strict=True):
            out.setdefault(name[0], {}).update(stamps)
    for name, stamp in _packed(top):
        out.setdefault(name[0], {}).setdefault(name, stamp)
    return out


def _packed(top: Path) -> Iterable[tuple[str, str]]:
    """Paths of the packed events, with their sizes and times before they were packed."""
    for folder, packed in top.known.folders(FOLDER).items() if isinstance(top, PackedPath) else ():
        start = folder.removeprefix(f"{FOLDER}/")
        for name, member in packed.files.items():
            yield f"{start}/{name}", f"{member.size}.{member.mtime_ns}"


def _of_shard(top: Path, shard: str) -> dict[str, str]:
    out: dict[str, str] = {}
    with os.scandir(top / shard) as units:
        for unit in units:
            if unit.is_dir():
                with os.scandir(unit.path) as entries:
                    events = [entry for entry in entries if entry.name.endswith(".json") and entry.name[0] != "."]
                for event in events:
                    about = event.stat()
                    out[f"{shard}/{unit.name}/{event.name}"] = f"{about.st_size}.{about.st_mtime_ns}"
    return out


def _objects(top: ObjectPath) -> Iterable[tuple[str, str]]:
    from pyarrow.fs import FileSelector, FileType

    for info in top.system.get_file_info(FileSelector(top.key, allow_not_found=True, recursive=True)):
        name = info.path.removeprefix(f"{top.key}/")
        if info.type == FileType.File and name.endswith(".json") and name.count("/") == 2:
            yield name, f"{info.size}.{info.mtime_ns}"
