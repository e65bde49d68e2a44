"""Names in manifests: a file of the archive may refer to files inside the archive only."""

from collections.abc import Iterator, Mapping
from typing import Any

from pipelines.archive.store import Place
from schemas.errors import ArchiveUnusable

FOLDERS = ("capture", "run", "rerun_of", "taken_from", "parents")  # entries that name folders of the archive
KEYS = ("content", "inputs", "manifests", "evidence", "events")  # entries whose keys name files of one folder
PATHS = "files"  # the entry whose keys are paths below the archive's root


class NameLeadsOut(ArchiveUnusable):
    """A manifest that names a file outside of the archive."""


class LinkInArchive(ArchiveUnusable, OSError):
    """A symbolic link below the top folders: what is behind it is no part of the archive, whoever made it."""


def is_plain(name: str) -> bool:
    """Whether a name is a plain file or folder name: no separator, no ``..``, not absolute."""
    return name not in {"", ".", ".."} and not any(mark in name for mark in "/\\\0")


def is_below(name: str) -> bool:
    """Whether a path with slashes stays below its folder."""
    return all(is_plain(part) for part in name.split("/"))


def refuse_leading_out(content: Mapping[str, Any], where: Place) -> None:
    """Refuse a manifest with a name that could lead out of the archive.

    Raises NameLeadsOut: with the entry and the name.
    """
    for entry, name, sound in _named(content):
        if not sound:
            raise NameLeadsOut(
                f"archive: {where} names {name[:80]!r} under '{entry}', a plain name without '/' and '..' is needed; the file "
                "was edited: do not use this archive, restore it from a copy"
            )


def _named(content: Mapping[str, Any]) -> Iterator[tuple[str, str, bool]]:
    """Entries and the names under them, with whether each is sound; values of other types are no names."""
    for entry in FOLDERS:
        names = content.get(entry)
        several = names if isinstance(names, list) else [names] if isinstance(names, str) and names else ()
        yield from ((entry, str(name), is_plain(str(name))) for name in several)
    for entry in (*KEYS, PATHS):
        names, sound = content.get(entry), is_below if entry == PATHS else is_plain
        yield from ((entry, name, sound(name)) for name in (names if isinstance(names, dict) else ()))
