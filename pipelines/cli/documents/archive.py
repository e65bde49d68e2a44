"""The JSON documents of the archive's maintenance."""

from __future__ import annotations

from typing import Annotated, Any

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


class ExtendDocument(TypedDict):
    """``extend --json``: the version of a model that was written."""

    file: str
    model: Annotated[str, "its name"]
    version: int
    effects: list[str]
    added: Annotated[str | None, "null: an effect was removed"]
    removed: Annotated[str | None, "null: an effect was added"]
    begun: Annotated[bool, "whether the file is new"]
    by: str
    at: Annotated[str, "ISO date and time, UTC"]
    why: str


class DemoErrors(TypedDict):
    """Errors of a model over all units, µg."""

    rms_ug: Annotated[float, "residual of the fit"]
    heldout_rms_ug: Annotated[float | None, "cross-validated"]
    fresh_rms_ug: Annotated[float | None, "on the second run"]
    floor_ug: Annotated[float, "noise of the measurement"]


class HiddenEffect(TypedDict):
    """The effect that the demonstration hid."""

    kind: str
    effect: str
    physics: str


class DemoDocument(TypedDict):
    """``demo --auto --json``: the hidden effect, the diagnosis, and the errors before and after."""

    seed: int
    hidden: HiddenEffect
    classes: Annotated[list[list[str]], "effects that the data do not separate, best first"]
    recommended: list[str]
    unseen: Annotated[list[Any], "effects that the plan cannot show, as in `diagnose --json`"]
    added: list[str]
    found: bool
    told_apart: Annotated[bool, "whether the hidden effect is alone in its class"]
    not_told_apart: list[list[str]]
    next_measurements: Annotated[list[Any], "as in `diagnose --json`"]
    before: DemoErrors
    after: DemoErrors
    folder: str


class DemoFilesDocument(TypedDict):
    """``demo --by-hand --json``: the files of the two runs."""

    folder: str
    files: list[str]
    effects: Annotated[list[str], "the model to begin with"]
