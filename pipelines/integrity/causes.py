"""One finding for each cause: the consequences of an edited or missing file are listed under it.

One edited manifest fails the check of its signature, of its key, of the chain and of each manifest that refers to it; a missing
folder gives one finding for each file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pipelines.integrity.findings import CHANGED, EDITED, MISSING, SIGNATURE, IntegrityFinding

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pipelines.archive.store import Place

FEWEST_GONE = 2  # missing files of a missing folder from which on the folder is reported instead


def by_cause(findings: Iterable[IntegrityFinding], root: Place) -> list[IntegrityFinding]:
    """The findings by cause; each path occurs once, and consequences are listed in the finding that caused them."""
    by_path: dict[str, list[IntegrityFinding]] = {}
    for finding in dict.fromkeys(findings):
        by_path.setdefault(finding.path, []).append(finding)
    causes = {path: _one(group) for path, group in by_path.items()}
    for folder, paths in _gone(causes, root).items():
        if len(paths) >= FEWEST_GONE:
            cause = IntegrityFinding(MISSING, folder, f"is missing, {len(paths)} of its files are named elsewhere")
            causes[folder] = _with(cause, [causes.pop(path) for path in paths])
    for path in list(causes):
        over = _manifest_of(path)
        if over in causes and causes[path].kind == CHANGED and causes[over].kind in {EDITED, SIGNATURE}:
            causes[over] = _with(causes[over], [causes.pop(path)])
    return list(causes.values())


def _one(findings: list[IntegrityFinding]) -> IntegrityFinding:
    """The findings of one path as one: an invalid signature first, then the first finding."""
    first = min(findings, key=lambda one: one.kind != SIGNATURE)
    return _with(first, [one for one in findings if one is not first])


def _with(cause: IntegrityFinding, more: Iterable[IntegrityFinding]) -> IntegrityFinding:
    lines = [line for one in more for line in (f"{one.path}: {one.message}", *one.consequences)]
    return replace(cause, consequences=(*cause.consequences, *lines))


def _gone(causes: Mapping[str, IntegrityFinding], root: Place) -> dict[str, list[str]]:
    """Missing files by the topmost folder that is missing with them."""
    out: dict[str, list[str]] = {}
    there: dict[str, bool] = {}
    for path, finding in causes.items():
        if finding.kind != MISSING:
            continue
        parents = [str(one) for one in PurePosixPath(path).parents if str(one) not in {".", *TOPS}]
        for folder in parents:
            if folder not in there:
                there[folder] = (root / folder).is_dir()
        gone = [folder for folder in parents if not there[folder]]
        if gone:
            out.setdefault(gone[-1], []).append(path)
    return out


TOPS = ("runs", "captures", "calibrations", "chain")


def _manifest_of(path: str) -> str:
    """The manifest of a table."""
    place = PurePosixPath(path)
    if place.suffix not in {".parquet", ".html"}:
        return ""
    return str(place.with_name("record.json") if place.parts[0] == "captures" else place.with_suffix(".json"))
