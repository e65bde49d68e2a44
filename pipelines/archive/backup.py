"""Copy of an archive to another disk or an object store, also during runs, and its restoration.

Files of an archive are written once, so a repeated copy adds only new files. The chain is read first and copied last: every file
that an entry of the copy names was copied before it. Files that the chain does not name yet (a lot that is being measured) are
copied in their present state and completed by the next copy; the seal of a run that ends during the copy is left to the next one
like the entry that it names. Derived files (``index/``, scores of runs) are left out; they are made again. What is packed is
copied as single files; the copy may be compacted by itself.

A file of the copy is never replaced by a damaged one. Files are written once, so one that differs from its copy is copied only
where the chain or its manifest states that it is sound; a capture's samples and records are stated by their record and by the
record after it. Only what an archive makes again in its place (reports, seals, checkpoints) is replaced, where it can be read.
"""

import json
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pipelines.archive import Archive, files, packs
from pipelines.archive.files import TEMPORARY
from pipelines.archive.hash_chain import name_of_entry
from pipelines.archive.store import Place
from schemas.errors import ArchiveUnusable, WrongUse

CHAIN, INDEX, MARK = "chain", "index", "archive.json"
STATE = "state"  # of a capture: its one file is replaced with every record
REMADE = re.compile(r"runs/[^/]+/(report\.(json|html)|sealed\.json)|captures/[^/]+/state/.*|.*/lock|orchestrator/.*")
_NEWEST, _WRITTEN_S = 4, 2.0  # entries whose runs may be without a seal, and the time in which their writers write it
DERIVED = re.compile(r"discovery/(lock|scores/.*|[^/]+/(lock|state|found))")
SEAL = re.compile(r"runs/[^/]+/sealed\.json")
WRITTEN_ONCE = ".parquet"  # such a file is there or not; others are compared byte for byte
PAGE = ".html"
_LISTED = 5


@dataclass
class Copied:
    """Result of a copy: files that were copied, their size in bytes, files that were there already."""

    files: int = 0
    bytes: int = 0
    present: int = 0


@dataclass(frozen=True)
class _ChainAtStart:
    """The chain of the source as it was when the copy began.

    entries : names of its entries
    hashes : SHA-256 of files by their names, as the newest entry that names each states it
    """

    entries: frozenset[str]
    hashes: Mapping[str, str]

    def lacks_entry_of(self, name: str, data: bytes) -> bool:
        """Whether a file is the seal of a run that names an entry written since the copy began."""
        with suppress(ValueError, TypeError, KeyError):  # 'tumbleline verify' reports it
            return bool(SEAL.fullmatch(name)) and name_of_entry(json.loads(data)["entry"]) not in self.entries
        return False


def copy_archive(source: Archive, target: Archive) -> Copied:
    """Copy the files that the target does not have yet.

    target : an empty or new folder, or an earlier copy of this archive
    Raises WrongUse: the target is the source, or lies in it.
    Raises ArchiveUnusable: the target holds something else, or an archive with another chain; a file was read differently
        than it was written; or files of the source are damaged that are sound in the target: these are kept, and all others
        are copied.
    """
    source.refuse_none()
    _refuse_itself(source, target)
    entries = _names(source.root / CHAIN, CHAIN)
    target.prepare()
    _refuse_another(source, target, entries)
    copied, hashes, links = Copied(), dict[str, str](), list[str]()
    for name in sorted(entries):
        hashes |= _manifest(source.root / name).get("files", {})
    chain = _ChainAtStart(frozenset(entries), hashes)
    names = [
        name
        for name in _names(source.root, "", links)
        if name not in entries and not name.startswith(f"{CHAIN}/") and name != MARK and not DERIVED.fullmatch(name)
    ]
    names += _late_seals(source.root, entries, set(names))
    damaged = [name for name in (*names, *sorted(entries)) if not _copy(source.root, target.root, name, chain, copied)]
    _drop_old_states(source.root, target.root)
    if damaged:
        raise ArchiveUnusable(
            f"backup: {len(damaged)} files of {source.root} are damaged and sound in {target.root}, where they were kept (the "
            f"first is {min(damaged)}); run 'tumbleline verify', and restore these files from {target.root}"
        )
    if links:
        raise ArchiveUnusable(
            f"backup: {len(links)} symbolic links in {source.root} were not followed: {', '.join(sorted(links)[:_LISTED])}"
            f"{', …' if len(links) > _LISTED else ''}; all other files were copied; replace the links by their content, or "
            "remove them"
        )
    return copied


def _late_seals(root: Place, entries: set[str], names: set[str]) -> list[str]:
    """Seals of runs that the newest entries of the chain state and which their writer had not written at the listing."""
    late: list[str] = []
    for name in sorted(entries)[-_NEWEST:]:
        run, until = _manifest(root / name).get("run"), time.monotonic() + _WRITTEN_S
        seal = f"runs/{run}/sealed.json"
        while run and seal not in names and time.monotonic() < until:
            if (root / seal).is_file():
                late.append(seal)
                break
            time.sleep(0.02)
    return late


def _manifest(path: Place) -> dict[str, Any]:
    """The content of a manifest; empty where it is not written yet, or damaged, which 'tumbleline verify' reports."""
    try:
        return files.read_json(path)
    except ArchiveUnusable:
        return {}


def _as_stated(root: Place, name: str, chain: _ChainAtStart) -> bool | None:
    """Whether a file is as the chain states, or a table as its manifest states; None where neither states its hash."""
    expected = chain.hashes.get(name, "") or _stated(root, name)
    return files.sha256(root / name) == expected if expected else None


def _stated(root: Place, name: str) -> str:
    """Hash of a file as the manifest beside it states it; empty where none does."""
    folder, _, file = name.rpartition("/")
    record = name.startswith("captures/") and file.endswith(WRITTEN_ONCE)
    if not record and not file.endswith((WRITTEN_ONCE, PAGE)):
        return ""
    manifest = _manifest(root / folder / ("record.json" if record else f"{file.rpartition('.')[0]}.json"))
    return str(manifest.get("content", {}).get(file, "") if record else manifest.get("sha256", ""))


def _is_damaged(source: Place, target: Place, name: str, chain: _ChainAtStart) -> bool:
    """Whether a file of the source that differs from its copy must not replace it."""
    if REMADE.fullmatch(name):
        return name.endswith(".json") and not _manifest(source / name)
    return not _as_stated(source, name, chain) and _as_stated(target, name, chain) is not False


def _names(folder: Place, prefix: str, links: list[str] | None = None) -> set[str]:
    """Names, below the root, of the files of a folder that are copied; symbolic links are added to ``links``."""
    names = _walk(folder, prefix, [] if links is None else links)
    return {name for name in names if PurePosixPath(name).parts[0] not in {INDEX, packs.FOLDER}}


def _walk(folder: Place, prefix: str, links: list[str]) -> Iterator[str]:
    if not folder.is_dir():
        return
    inside: list[Place] = []
    with suppress(FileNotFoundError):  # a writer has removed or renamed it meanwhile
        inside += [path for path in folder.iterdir() if not path.name.startswith(TEMPORARY)]
    for path in inside:
        name = f"{prefix}/{path.name}" if prefix else path.name
        if prefix and isinstance(path, Path) and path.is_symlink():  # a top folder may lie on another disk
            links.append(name)
        elif path.is_dir():
            yield from _walk(path, name, links)
        else:
            yield name


def _copy(source: Place, target: Place, name: str, chain: _ChainAtStart, copied: Copied) -> bool:
    """Copy a file unless it is there; a file that vanished meanwhile (state, temporary) is left out, as is a newer seal.

    False where the copy in the target stays, because the file of the source is damaged.
    """
    from_path, to_path = source / name, target / name
    try:
        if to_path.is_file() and _same(from_path, to_path, name):
            copied.present += 1
            return True
        if to_path.is_file() and _is_damaged(source, target, name, chain):
            return False
        data = from_path.read_bytes()
    except FileNotFoundError:
        return True
    if chain.lacks_entry_of(name, data):
        return True
    files.publish(to_path, data)
    if files.sha256(to_path) != files.hash_of(data):
        raise ArchiveUnusable(f"backup: {to_path} was read differently than it was written; check the disk of the copy")
    copied.files += 1
    copied.bytes += len(data)
    return True


def _same(from_path: Place, to_path: Place, name: str) -> bool:
    if from_path.stat().st_size != to_path.stat().st_size:
        return False
    return name.endswith(WRITTEN_ONCE) or files.sha256(from_path) == files.sha256(to_path)


def _refuse_itself(source: Archive, target: Archive) -> None:
    root, to_root = source.root, target.root
    inside = isinstance(root, Path) and isinstance(to_root, Path) and to_root.resolve().is_relative_to(root.resolve())
    if inside or str(root) == str(to_root):
        raise WrongUse(f"backup: {to_root} lies in the archive {root}, another disk or store is needed; name one")


def _refuse_another(source: Archive, target: Archive, entries: set[str]) -> None:
    """Refuse a target whose chain is not the beginning of that of the source: a copy of another archive, or a newer one."""
    for name in sorted(_names(target.root / CHAIN, CHAIN)):
        if name not in entries or files.sha256(source.root / name) != files.sha256(target.root / name):
            raise ArchiveUnusable(
                f"backup: {target.root} has the entry {name} of a chain that {source.root} does not have, an earlier copy of "
                "this archive or an empty folder is needed; name another, and run 'tumbleline verify' on both"
            )


def _drop_old_states(source: Place, target: Place) -> None:
    """Remove checkpoints from the copy that later ones have replaced, as the capture itself does.

    Where the copy has more records of a capture than the source, the source is the older one (a restored backup): nothing is
    removed, so that the capture continues from its last record.
    """
    captures = target / "captures"
    for capture in captures.iterdir() if captures.is_dir() else ():
        original = source / "captures" / capture.name
        if _records(capture) > _records(original):
            continue
        for old in (capture / STATE).glob("*.bin") if (capture / STATE).is_dir() else ():
            if not (original / STATE / old.name).is_file():
                old.unlink(missing_ok=True)


def _records(capture: Place) -> int:
    """Number of complete records of a capture."""
    return sum((path / "record.json").is_file() for path in capture.iterdir()) if capture.is_dir() else 0
