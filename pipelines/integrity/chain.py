"""Checks of the chain of an archive: no entry is missing or edited, and the files that they seal are unchanged."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePosixPath

from pipelines.archive import files, hash_chain
from pipelines.archive.store import Place
from pipelines.integrity.findings import EDITED, MISSING, VerifiedPart


@dataclass
class Chain:
    """Content of the chain.

    Parameters
    ----------
    head : hash of its last entry.
    sealed : the files that it names, with the hash that the last entry to name them gives.
    entries : what each entry seals, by its number.
    differing : the files that differ from what it sealed.
    """

    head: str = ""
    sealed: dict[str, str] = field(default_factory=dict[str, str])
    entries: dict[int, dict[str, str]] = field(default_factory=dict[int, "dict[str, str]"])
    differing: set[str] = field(default_factory=set[str])


def check_chain(root: Place, checked: VerifiedPart, *, only: set[str] | None = None, head: str = "") -> Chain:
    """Read and check the chain; findings go into ``checked``.

    Parameters
    ----------
    only : runs whose sealed files are checked; all where None.
    head : hash of an entry from a copy kept elsewhere; it must exist.
    """
    before, seen, chain, latest = "", set[str](), Chain(), ""
    for number, place in hash_chain.entries(root):
        part = checked.blank()
        manifest = part.manifest(place, 1)
        if only is not None and (manifest is None or manifest[0].get("run") not in only):
            part.untrusted = {
                state: [] for state in part.untrusted
            }  # signatures of entries of other runs are not checked
        checked.add(part)
        if manifest is None:
            before = ""
            continue
        content, own = manifest
        if content.get("number") != number:
            checked.wrong(EDITED, place, f"says that it is entry {content.get('number')!r}")
        if before and content.get("previous") != before:
            earlier = hash_chain.place_of_entry(root, number - 1)
            checked.wrong(EDITED, earlier, f"is not the entry that number {number} refers to")
        chain.entries[number] = _files(checked.named(content, "files", place))
        if only is None or content.get("run") in only:
            chain.sealed |= chain.entries[number]
        when = str(content.get("when", ""))
        if when < latest:
            checked.remarks.append(
                f"entry {number} of the chain says {when}, one before it {latest}: a clock was set back"
            )
        before, latest = own, max(when, latest)
        seen.add(own)
    if head and head not in seen:
        checked.wrong(
            MISSING, root / hash_chain.FOLDER, f"has no entry with hash {head}: entries were removed or written again"
        )
    chain.differing = {name for name, hashed in chain.sealed.items() if not _is_sealed(root, name, hashed, checked)}
    chain.head = before
    return chain


def _files(named: dict[str, str]) -> dict[str, str]:
    """What an entry seals; names that lead out of the archive are ignored."""
    return {k: v for k, v in named.items() if ".." not in PurePosixPath(k).parts and not k.startswith("/")}


def _is_sealed(root: Place, name: str, expected: str, checked: VerifiedPart) -> bool:
    """Whether a file is there as it was sealed."""
    place = root / name
    try:
        actual = files.sha256(place)
    except OSError:
        checked.wrong(MISSING, place, "is missing, the chain of the archive names it")
        return False
    if actual != expected:
        checked.wrong(EDITED, place, "differs from what the chain of the archive sealed")
    return actual == expected
