"""Checks of the packs of an archive: every zip is as its table of contents says, and that is as it was sealed.

The files in a pack are checked like single files, by their manifests and the chain; these checks find a damaged zip whose
single files nobody asks for.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.archive import derived, files
from pipelines.archive.packs import CONTAINER, CONTENTS, FOLDER, Contents
from pipelines.integrity.findings import CHANGED, MISSING, UNREADABLE

if TYPE_CHECKING:
    from pipelines.archive import Archive
    from pipelines.integrity.findings import VerifiedPart

REMEDY = "restore it from a copy"


def check_packs(archive: Archive, checked: VerifiedPart) -> None:
    """The findings about the packs of an archive; those in an object store have none."""
    if not isinstance(archive.root, Path):
        return
    known = set[str]()
    top = archive.root / FOLDER
    for place in sorted(top.glob(f"*{CONTENTS}")) if top.is_dir() else ():
        pack = place.with_suffix(CONTAINER)
        known.add(pack.name)
        if not pack.is_file():
            checked.wrong(MISSING, pack, f"is missing, its table of contents is there: {REMEDY}")
            continue
        try:
            state, about = derived.unframed(place)[1], Contents(place).about()
            changed = files.sha256(pack) != about.get("sha256")
        except (OSError, ValueError):
            checked.wrong(UNREADABLE, place, f"is no table of contents of a pack: {REMEDY}")
            continue
        if state == derived.EDITED:
            checked.wrong(CHANGED, place, f"was edited since the pack was made: {REMEDY}")
        if changed:
            checked.wrong(CHANGED, pack, f"has changed since it was made: {REMEDY}")
    for place in sorted(top.glob(f"*{CONTAINER}")) if top.is_dir() else ():
        if place.name not in known:
            checked.remarks.append(
                f"{checked.name(place)} has no table of contents: a compaction was killed; the next one removes it"
            )
