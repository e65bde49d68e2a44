"""Checks of a whole archive, or of some of its runs with their captures, read side by side."""

import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import Archive, Run, derived, files
from pipelines.archive.listing import SEALED, agrees, info_of, stamp_of, stored_lines
from pipelines.archive.packs import CONTAINER, CONTENTS, Contents
from pipelines.archive.packs import FOLDER as PACKS
from pipelines.archive.records import COMPLETE
from pipelines.archive.signatures import GOOD, UNKNOWN, UNSIGNED
from pipelines.archive.store import ObjectPath, Place
from pipelines.certificates.entries import FOLDER as LEDGER
from pipelines.certificates.ledger_index import DIGITS, INDEX_FOLDER, all_read, indexed_events, stamps_of
from pipelines.integrity.causes import by_cause
from pipelines.integrity.findings import CHANGED, MISSING, SIGNATURE, UNREADABLE, IntegrityFinding, VerifiedPart
from pipelines.integrity.runs import check_capture, check_run, check_strangers
from pipelines.integrity.seals import check_chain, check_seals, check_shard
from pipelines.integrity.surroundings import SHOWN, check_links, check_mark, check_surroundings
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey


NEEDED = "a signature by the own key, or by one given with --trust, is needed"
MADE_AGAIN = "remove the file, it is made again automatically"
FROM_A_COPY = "restore it from a copy"
READERS = min(8, 2 * (os.cpu_count() or 1))
READERS_OF_OBJECTS = 32  # an object store answers slowly, but many requests at once


@dataclass(frozen=True)
class Report:
    """Result of a verification.

    head : hash of the last entry of the chain; a copy of it elsewhere shows later whether entries were removed.
    trust : sentence about the signatures.
    """

    checked: VerifiedPart
    head: str
    trust: str
    runs: int
    captures: int
    seconds: float

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not self.checked.findings

    def document(self) -> dict[str, Any]:
        """The report for JSON."""
        checked = self.checked
        return {
            "archive": str(checked.root),
            "whole": self.whole,
            "findings": [
                {key: value for key, value in asdict(finding).items() if key != "because"}
                for finding in checked.findings
            ],
            "remarks": checked.remarks,
            "signatures": {"trust": self.trust, "keys": sorted(checked.keys), "manifests": dict(checked.signatures)},
            "chain_head": self.head,
            "runs": self.runs,
            "captures": self.captures,
            **checked.counts,
            "seconds": self.seconds,
            "rows_per_s": checked.rows / self.seconds,
            "bytes_per_s": checked.bytes / self.seconds,
        }


def verify(
    archive: Archive,
    runs: Sequence[str] = (),
    *,
    keys: "Mapping[str, Ed25519PublicKey]",
    demanded: bool = False,
    head: str = "",
    also: Sequence[Callable[[Archive, VerifiedPart], None]] = (),
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Report:
    """Verify an archive. While something in it is being written, only what two readings find is told.

    A record that was stored between two looks at its capture is no finding, and neither is a seal that is newer than the chain
    that was read.

    runs : only these runs and their captures; the whole archive where empty.
    keys : public keys that are trusted, by name.
    demanded : whether a manifest without a signature by one of these is wrong.
    head : hash of an entry of the chain from a copy elsewhere.
    also : further checks of the whole archive, of tables that this package does not know.
    """
    open_still = _being_written(archive, runs)
    looked = partial(_verified, archive, runs, keys, demanded=demanded, head=head, also=also, progress=progress)
    report = looked()
    if report.checked.findings and open_still:
        first, report = {(finding.kind, finding.path) for finding in report.checked.findings}, looked()
        report.checked.findings = [
            finding for finding in report.checked.findings if (finding.kind, finding.path) in first
        ]
    return report


def _being_written(archive: Archive, runs: Sequence[str]) -> bool:
    """Whether a capture is not finished or a run not sealed: their writers may be at work."""
    captures = _below(archive.root / "captures") if not runs else []
    ends = [*(run.path / SEALED for run in _chosen(archive, runs)), *(path / COMPLETE for path in captures)]
    return not all(end.is_file() for end in ends)


def _chosen(archive: Archive, runs: Sequence[str]) -> list[Run]:
    """The runs of these names; all where none is named."""
    return [archive.run(name) for name in runs] or [
        Run(archive, folder.name) for folder in _below(archive.root / "runs")
    ]


def _verified(
    archive: Archive,
    runs: Sequence[str],
    keys: "Mapping[str, Ed25519PublicKey]",
    *,
    demanded: bool,
    head: str,
    also: Sequence[Callable[[Archive, VerifiedPart], None]],
    progress: Callable[[int, int], None],
) -> Report:
    """The report of a single pass over an archive."""
    from schemas import tables

    start, total = time.perf_counter(), VerifiedPart(archive.root, keys)
    there = _below(archive.root / "captures")  # before the runs: each run is there before its capture
    chosen = _chosen(archive, runs)
    captures = _captures(archive, chosen) if runs else there
    check_links(archive, [run.path for run in chosen] + captures if runs else _below(archive.root), total)
    if total.findings:
        total.remarks.append(
            "symbolic links are not followed: nothing else was checked until they are replaced or removed"
        )
        return Report(total, "", _trust(total), len(chosen), len(captures), time.perf_counter() - start)
    shards = [] if runs else _below(archive.root / "calibrations")
    tasks: list[Callable[[], VerifiedPart]] = [
        *(lambda run=run: check_run(run, total.blank(), tables.VERSION) for run in chosen),
        *(lambda path=path: check_capture(path, total.blank(), tables.VERSION) for path in captures),
        *(lambda shard=shard: check_shard(shard, total.blank()) for shard in shards),
    ]
    readers = READERS_OF_OBJECTS if isinstance(archive.root, ObjectPath) else READERS
    with ThreadPoolExecutor(readers) as pool:
        for done, part in enumerate(pool.map(lambda task: task(), tasks), 1):
            total.add(part)
            progress(done, len(tasks))
    for folder in () if runs else ("", "runs", "captures", *(f"captures/{path.name}" for path in captures)):
        check_strangers(archive.root / folder if folder else archive.root, set(), total)
    chain = check_chain(archive.root, total, only={run.id for run in chosen} if runs else None, head=head)
    check_seals(archive.root, chosen, chain, total, everything=not runs)
    check_mark(archive, total)
    if not runs:
        check_packs(archive, total)
        _check_owners(chosen, captures, total)
        check_surroundings(archive, total)
        check_list(archive, total)
        check_ledger_index(archive, total)
        for check in also:
            check(archive, total)
    _report_untrusted(total, demanded=demanded)
    total.findings = by_cause(total.findings, archive.root, chain.differing)
    return Report(total, chain.head, _trust(total), len(chosen), len(captures), time.perf_counter() - start)


def _captures(archive: Archive, runs: Sequence[Run]) -> list[Place]:
    named = dict.fromkeys(str(run.about.get("capture") or "") for run in runs)
    return [archive.root / "captures" / name for name in named if name and (archive.root / "captures" / name).is_dir()]


def _check_owners(runs: Sequence[Run], captures: Sequence[Place], total: VerifiedPart) -> None:
    """Every capture has a run that it was measured for."""
    named: set[str] = set()
    for run in runs:
        try:
            named.add(str(run.about.get("capture") or ""))
        except ArchiveUnusable:  # the check of the run reports it
            return
    what = "has no run in this archive: the run was removed, or the capture was copied here"
    for path in captures:
        if path.name not in named:
            total.wrong(MISSING, path, what)


def _below(folder: Place) -> list[Place]:
    if not folder.is_dir():
        return []
    return sorted((path for path in folder.iterdir() if path.is_dir()), key=lambda path: path.name)


def _report_untrusted(total: VerifiedPart, *, demanded: bool) -> None:
    """Report manifests without a trusted signature: a finding where a signature is required, a remark where others are signed."""
    for state, names in total.untrusted.items():
        what = "is not signed" if state == UNSIGNED else "is signed with a key that is not known here"
        if demanded and len(names) > SHOWN:
            each = f"{len(names)} of {total.manifests} manifests: each {what}; {NEEDED}"
            total.findings.append(IntegrityFinding(SIGNATURE, total.name(total.root), each, tuple(names)))
        elif demanded:
            for name in names:
                total.wrong(SIGNATURE, total.root / name, f"{what}; {NEEDED}")
        elif len(names) < total.manifests:
            shown = f"{', '.join(names[:SHOWN])}{f' and {len(names) - SHOWN} more' if len(names) > SHOWN else ''}"
            total.remarks += [f"{shown} {what.replace('is', 'are', 1) if len(names) > 1 else what}"] if names else []


def _trust(total: VerifiedPart) -> str:
    count, signatures = total.manifests, total.signatures
    if signatures[UNSIGNED] == count:
        return "UNSIGNED: nothing shows who wrote this archive; make a key with 'tumbleline archive key'"
    parts = {
        GOOD: f"{signatures[GOOD]} of {count} manifests signed by {', '.join(sorted(total.keys))}",
        UNKNOWN: f"{signatures[UNKNOWN]} signed by a key that is not known here (give it with --trust)",
        UNSIGNED: f"{signatures[UNSIGNED]} unsigned",
    }
    return ", ".join(text for state, text in parts.items() if signatures[state])


def check_list(archive: Archive, checked: VerifiedPart) -> None:
    """Lines of the list must agree with the runs, where these were not changed since."""
    path = archive.root / "index" / "list.json"
    lines, state = stored_lines(path)
    if state == derived.EDITED:
        checked.wrong(CHANGED, path, f"was edited since it was made: {MADE_AGAIN}")
    for name, (stamp, line) in lines.items():
        run = Run(archive, name)
        if stamp_of(run) != stamp:
            continue
        try:
            info = info_of(run)
        except (ArchiveUnusable, KeyError, TypeError):  # the check of the run reports it
            continue
        if info is None or not agrees(info, line):
            checked.wrong(CHANGED, path, f"disagrees with the files of run {name}: {MADE_AGAIN}")


def check_ledger_index(archive: Archive, checked: VerifiedPart) -> None:
    """Events of the index must agree with the files of the ledger, where these were not changed since."""
    stamps = stamps_of(archive.root / LEDGER)
    for digit in DIGITS:
        path = archive.root / INDEX_FOLDER / f"{digit}.noted"
        stored, state = indexed_events(path)
        if state == derived.EDITED:
            checked.wrong(CHANGED, path, f"was edited since it was made: {MADE_AGAIN}")
        current = stamps.get(digit, {})
        held = [name for name, event in stored.items() if current.get(name) == event.stamp]
        if any(stored[name].event != event for name, event in all_read(archive.root / LEDGER, held).items()):
            checked.wrong(CHANGED, path, f"disagrees with the files of the ledger: {MADE_AGAIN}")


def check_packs(archive: Archive, checked: VerifiedPart) -> None:
    """The findings about the packs of an archive; those in an object store have none."""
    if not isinstance(archive.root, Path):
        return
    top = archive.root / PACKS
    if not top.is_dir():
        return
    for contents in sorted(top.glob(f"*{CONTENTS}")):
        pack = contents.with_suffix(CONTAINER)
        if not pack.is_file():
            checked.wrong(MISSING, pack, f"is missing, its table of contents is there: {FROM_A_COPY}")
            continue
        try:
            state, about = derived.unframed(contents)[1], Contents(contents).about()
            changed = files.sha256(pack) != about.get("sha256")
        except (OSError, ValueError):
            checked.wrong(UNREADABLE, contents, f"is no table of contents of a pack: {FROM_A_COPY}")
            continue
        if state == derived.EDITED:
            checked.wrong(CHANGED, contents, f"was edited since the pack was made: {FROM_A_COPY}")
        if changed:
            checked.wrong(CHANGED, pack, f"has changed since it was made: {FROM_A_COPY}")
    for pack in sorted(top.glob(f"*{CONTAINER}")):
        if not pack.with_suffix(CONTENTS).is_file():
            what = "has no table of contents: a compaction was killed; the next one removes it"
            checked.remarks.append(f"{checked.name(pack)} {what}")
