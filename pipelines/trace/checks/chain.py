"""Checks of the archive's chain: no entry is missing or edited, and what they seal is there as it was."""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Any

from pipelines.archive import chain, files
from pipelines.trace.checks.findings import EDITED, MISSING, Checked

if TYPE_CHECKING:
    from pipelines.archive.store import Place


def check_chain(root: Place, checked: Checked, *, only: set[str] | None = None, head: str = "") -> str:
    """The hash of the chain's last entry; what is wrong goes into ``checked``.

    Parameters
    ----------
    only : runs whose sealed files are looked at; all where None.
    head : hash of an entry that was noted elsewhere; it must be there.
    """
    before, seen, sealed, latest = "", set[str](), dict[str, str](), ""
    for number, place in chain.entries(root):
        found = checked.manifest(place, 1)
        if found is None:
            before = ""
            continue
        content, own = found
        if before and content.get("previous") != before:
            earlier = chain.place_of_entry(root, number - 1)
            checked.wrong(EDITED, earlier, f"is not the entry that number {number} followed")
        if only is None or content.get("run") in only:
            sealed |= _files(content)
        when = str(content.get("when", ""))
        if when < latest:
            checked.remarks.append(
                f"entry {number} of the chain says {when}, one before it {latest}: a clock went backwards"
            )
        before, latest = own, max(when, latest)
        seen.add(own)
    if head and head not in seen:
        checked.wrong(
            MISSING, root / chain.FOLDER, f"has no entry with hash {head}: entries were taken away or written anew"
        )
    for name, wanted in sealed.items():
        _check_sealed(root, name, wanted, checked)
    return before


def _files(content: dict[str, Any]) -> dict[str, str]:
    """What an entry seals; names that lead out of the archive do not count."""
    named = content.get("files", {})
    return {
        str(k): str(v)
        for k, v in named.items()
        if ".." not in PurePosixPath(str(k)).parts and not str(k).startswith("/")
    }


def _check_sealed(root: Place, name: str, wanted: str, checked: Checked) -> None:
    place = root / name
    try:
        found = files.sha256(place)
    except OSError:
        checked.wrong(MISSING, place, "is not there, the archive's chain names it")
        return
    if found != wanted:
        checked.wrong(EDITED, place, "is not as the archive's chain sealed it")
