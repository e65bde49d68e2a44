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
