"""Checks of the archive's chain: no entry is missing or edited, and what they seal is there as it was."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pipelines.archive import files, hash_chain
from pipelines.integrity.findings import EDITED, MISSING, CheckedPart

if TYPE_CHECKING:
    from pipelines.archive.store import Place


@dataclass
class Chain:
    """What the chain says.

    Parameters
    ----------
    head : hash of its last entry.
    sealed : the files that it names, with the hash that the last entry to name them gives.
    entries : what each entry seals, by its number.
    """

    head: str = ""
    sealed: dict[str, str] = field(default_factory=dict[str, str])
    entries: dict[int, dict[str, str]] = field(default_factory=dict[int, "dict[str, str]"])


def check_chain(root: Place, checked: CheckedPart, *, only: set[str] | None = None, head: str = "") -> Chain:
    """What the chain says; what is wrong goes into ``checked``.

    Parameters
    ----------
    only : runs whose sealed files are looked at; all where None.
    head : hash of an entry that was noted elsewhere; it must be there.
    """
    before, seen, told, latest = "", set[str](), Chain(), ""
    for number, place in hash_chain.entries(root):
        part = checked.blank()
        found = part.manifest(place, 1)
        if only is not None and (found is None or found[0].get("run") not in only):
            part.untrusted = {state: [] for state in part.untrusted}  # who signed entries of other runs is not asked
        checked.add(part)
        if found is None:
            before = ""
            continue
        content, own = found
        if content.get("number") != number:
            checked.wrong(EDITED, place, f"says that it is entry {content.get('number')!r}")
        if before and content.get("previous") != before:
            earlier = hash_chain.place_of_entry(root, number - 1)
            checked.wrong(EDITED, earlier, f"is not the entry that number {number} followed")
        told.entries[number] = _files(checked.named(content, "files", place))
        if only is None or content.get("run") in only:
            told.sealed |= told.entries[number]
        when = str(content.get("when", ""))
        if when < latest:
            checked.remarks.append(
                f"entry {number} of the chain says {when}, one before it {latest}: a clock went backwards"
            )
        before, latest = own, max(when, latest)
        seen.add(own)
    if head and head not in seen:
        checked.wrong(
            MISSING, root / hash_chain.FOLDER, f"has no entry with hash {head}: entries were taken away or written anew"
        )
    for name, wanted in told.sealed.items():
        _check_sealed(root, name, wanted, checked)
    told.head = before
    return told


def _files(named: dict[str, str]) -> dict[str, str]:
    """What an entry seals; names that lead out of the archive do not count."""
    return {k: v for k, v in named.items() if ".." not in PurePosixPath(k).parts and not k.startswith("/")}


def _check_sealed(root: Place, name: str, wanted: str, checked: CheckedPart) -> None:
    place = root / name
    try:
        found = files.sha256(place)
    except OSError:
        checked.wrong(MISSING, place, "is not there, the archive's chain names it")
        return
    if found != wanted:
        checked.wrong(EDITED, place, "is not as the archive's chain sealed it")
