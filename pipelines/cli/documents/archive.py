"""The JSON documents of the archive's maintenance."""

from __future__ import annotations

from typing import Annotated

from typing_extensions import TypedDict


class ArchiveCleanDocument(TypedDict):
    """``archive clean --json``: temporary files of killed writers, and finished runs added to the chain."""

    archive: str
    only_looked: Annotated[bool, "`--dry-run`: nothing was changed"]
    removed: list[str]
    bytes: int
    busy: Annotated[list[str], "folders that another process writes to"]
    sealed: Annotated[list[str], "runs added to the chain"]
    anchored: Annotated[int, "calibrations added to the chain"]


class ArchiveKeyDocument(TypedDict):
    """``archive key --json``: the key that signs manifests."""

    name: str
    public: Annotated[str, "hexadecimal"]
    private_file: str


class ArchiveCompactDocument(TypedDict):
    """``archive compact --json``: files of finished runs put into packs."""

    archive: str
    packs: Annotated[list[str], "names of the new packs, below `packed/`"]
    packed: Annotated[int, "files that are in a pack now and were in none before"]
    bytes: Annotated[int, "size of these files"]
    freed: Annotated[int, "single files that were removed"]
    kept: Annotated[list[str], "folders that changed, or that another process used; the next compaction packs them"]
    unfinished: Annotated[list[str], "runs that are not finished; they stay as they are"]


class Copied(TypedDict):
    """Files of a copy."""

    files: Annotated[int, "copied"]
    bytes: int
    present: Annotated[int, "files that were there already"]


class ArchiveBackupDocument(Copied):
    """``archive backup --json``: a copy of the archive."""

    archive: str
    copy: str
    database: Annotated[str | None, "the copy of the orchestrator's database; null: not copied"]


class ArchiveRestoreDocument(Copied):
    """``archive restore --json``: an archive restored from a copy, and verified."""

    archive: str
    copy: str
    whole: Annotated[bool, "whether the verification has no findings"]
    head: Annotated[str | None, "hash at the end of the chain"]
