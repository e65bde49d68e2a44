"""One finding per cause: what follows from a file that was edited or is gone stands under it, not beside it.

One edited manifest is told by its signature, by its key, by the chain and by each manifest that was made from it; a folder that
is gone is told file by file.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from pipelines.integrity.findings import CHANGED, EDITED, MISSING, SIGNATURE, IntegrityFinding

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from pipelines.archive.store import Place

FEWEST_GONE = 2  # files of a folder that is not there, before the folder is told in their place


def by_cause(findings: Iterable[IntegrityFinding], root: Place) -> list[IntegrityFinding]:
    """The findings with those that follow from another one among its consequences; every path once."""
    by_path: dict[str, list[IntegrityFinding]] = {}
    for finding in dict.fromkeys(findings):
        by_path.setdefault(finding.path, []).append(finding)
    causes = {path: _one(found) for path, found in by_path.items()}
    for folder, paths in _gone(causes, root).items():
        if len(paths) >= FEWEST_GONE:
            told = IntegrityFinding(MISSING, folder, f"is not there, {len(paths)} files of it are named elsewhere")
            causes[folder] = _with(told, [causes.pop(path) for path in paths])
    for path in list(causes):
        over = _manifest_of(path)
        if over in causes and causes[path].kind == CHANGED and causes[over].kind in {EDITED, SIGNATURE}:
            causes[over] = _with(causes[over], [causes.pop(path)])
    return list(causes.values())


def _one(found: list[IntegrityFinding]) -> IntegrityFinding:
    """The findings of one path as one: a false signature says most, then what was said first."""
    first = min(found, key=lambda one: one.kind != SIGNATURE)
    return _with(first, [one for one in found if one is not first])


def _with(cause: IntegrityFinding, more: Iterable[IntegrityFinding]) -> IntegrityFinding:
    lines = [line for one in more for line in (f"{one.path}: {one.message}", *one.consequences)]
    return replace(cause, consequences=(*cause.consequences, *lines))


def _gone(causes: Mapping[str, IntegrityFinding], root: Place) -> dict[str, list[str]]:
    """Missing files by the topmost folder that is gone with them."""
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
    """The manifest that a table is told in."""
    place = PurePosixPath(path)
    if place.suffix not in {".parquet", ".html"}:
        return ""
    return str(place.with_name("record.json") if place.parts[0] == "captures" else place.with_suffix(".json"))
