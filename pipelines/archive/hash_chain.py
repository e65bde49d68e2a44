"""The archive's chain: numbered entries, each with the hash of the entry before and of the manifests that it seals.

``chain/<thousands>/<number>.json``. An entry is created once; of two processes that write the next entry, one succeeds and the
other takes the next number. A copy of the hash of the last entry, kept elsewhere, shows later whether an entry was removed.
"""

from collections.abc import Iterator, Mapping
from contextlib import nullcontext
from typing import Any

from pipelines.archive import files
from pipelines.archive.locks import alone
from pipelines.archive.store import ObjectPath, Place

FOLDER = "chain"
SHARD = 1000


def append(root: Place, kind: str, sealed: Mapping[str, str], about: Mapping[str, Any]) -> int:
    """The number of a new entry.

    kind : ``run``, ``calibrations``, ``programming`` or ``release``.
    sealed : hashes of files by their path below the archive's root.
    about : who wrote it, where and when, and about what.
    """
    top = root / FOLDER
    with alone(top, wait=True) if isinstance(root, ObjectPath) else nullcontext():
        number = last_number(root) + 1
        while True:
            previous = files.sha256(path_of_entry(root, number - 1)) if number > 1 else ""
            position = {"number": number, "kind": kind, "previous": previous, "schema": 1}
            content = files.manifest_bytes({**about, **position, "files": dict(sealed)})
            if files.publish_first(path_of_entry(root, number), content):
                return number
            number += 1


def is_number(name: str) -> bool:
    """Whether a name is a number as the archive writes it; digits of other scripts and signs like ² are none."""
    return name.isascii() and name.isdigit()


def last_number(root: Place) -> int:
    """The number of the last entry; 0 where there is none."""
    top = root / FOLDER
    shards = sorted((int(folder.name) for folder in _below(top) if is_number(folder.name)), reverse=True)
    for shard in shards:
        numbers = [int(path.stem) for path in _below(top / f"{shard:06d}") if is_number(path.stem)]
        if numbers:
            return max(numbers)
    return 0


def entries(root: Place) -> Iterator[tuple[int, Place]]:
    """Numbers and paths of the entries up to the last, whether they are there or not."""
    for number in range(1, last_number(root) + 1):
        yield number, path_of_entry(root, number)


def sealed_names(root: Place) -> set[str]:
    """The files, by their path below the archive's root, that an entry seals."""
    return {name for _, path in entries(root) if path.is_file() for name in files.read_json(path)["files"]}


def name_of_entry(number: int) -> str:
    """Name of an entry's file, below the root of the archive."""
    return f"{FOLDER}/{number // SHARD:06d}/{number:09d}.json"


def path_of_entry(root: Place, number: int) -> Place:
    """Path of an entry."""
    return root / name_of_entry(number)


def _below(folder: Place) -> list[Place]:
    return list(folder.iterdir()) if isinstance(folder, ObjectPath) or folder.is_dir() else []
