"""One finding for each cause: the consequences of an edited or missing file are listed under it.

One edited manifest fails the check of its signature, of its key, of the chain and of each manifest that refers to it; a missing
folder gives one finding for each file.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import PurePosixPath

from pipelines.archive.store import Place
from pipelines.integrity.findings import CHANGED, EDITED, MISSING, SIGNATURE, IntegrityFinding
from pipelines.integrity.seals import OF_ANOTHER

FEWEST_GONE = 2  # missing files of a missing folder from which on the folder is reported instead


NAMED = 6  # further edited files that a message names


def by_cause(
    findings: Iterable[IntegrityFinding], root: Place, differing: Collection[str] = ()
) -> list[IntegrityFinding]:
    """The findings by cause; each path occurs once, and consequences are listed in the finding that caused them.

    differing : files that differ from what the chain sealed: of two files that disagree, these were edited
    """
    by_path: dict[str, list[IntegrityFinding]] = {}
    for finding in dict.fromkeys(findings):
        by_path.setdefault(finding.path, []).append(finding)
    causes = {path: _joined(group) for path, group in by_path.items()}
    for folder, paths in _gone(causes, root).items():
        if len(paths) >= FEWEST_GONE:
            cause = IntegrityFinding(MISSING, folder, f"is missing, {len(paths)} of its files are named elsewhere")
            causes[folder] = _with(cause, [causes.pop(path) for path in paths])
    for path in list(causes):
        over = _manifest_of(path)
        if over in causes and causes[path].kind == CHANGED and causes[over].kind in {EDITED, SIGNATURE}:
            causes[over] = _with(causes[over], [causes.pop(path)])
    _without_disagreements(causes, by_path, differing)
    _by_folder(causes, by_path, differing)
    return [replace(finding, because="") for finding in causes.values()]


def _without_disagreements(
    causes: dict[str, IntegrityFinding], by_path: Mapping[str, Sequence[IntegrityFinding]], differing: Collection[str]
) -> None:
    """List a file that is as it was sealed, and only disagrees with another, under that other file."""
    for path in list(causes):
        links = [finding.because for finding in by_path.get(path, ())]
        if path not in causes or path in differing or not links or not all(links):
            continue
        others = [link for link in dict.fromkeys(links) if link in causes and link != path]
        proved = [link for link in others if link in differing]
        direct = [link for link in others if any(not finding.because for finding in by_path.get(link, ()))]
        fuller = [link for link in others if len(by_path.get(link, ())) > len(links)]
        for other in (proved or direct or fuller)[:1]:
            causes[other] = _with(causes[other], [causes.pop(path)])


def _by_folder(
    causes: dict[str, IntegrityFinding], by_path: Mapping[str, Sequence[IntegrityFinding]], differing: Collection[str]
) -> None:
    """Join the findings on edited manifests of a run or capture, since they are mostly edited together."""
    folders: dict[str, list[str]] = {}
    for path, cause in causes.items():
        parts = PurePosixPath(path).parts
        if parts[:1] in {("runs",), ("captures",)} and path.endswith(".json") and cause.kind in {EDITED, SIGNATURE}:
            folders.setdefault("/".join(parts[:2]), []).append(path)

    def rank(path: str) -> tuple[bool, bool, bool, int]:
        findings = by_path.get(path, ())
        exchanged = any(finding.message.startswith(OF_ANOTHER) for finding in findings)
        moved = any(finding.kind == CHANGED for finding in findings)  # numbers, not only hashes
        return not exchanged, not moved, path not in differing, -len(findings)

    for paths in folders.values():
        if len(paths) > 1:
            paths.sort(key=rank)
            names = [PurePosixPath(path).name for path in paths[1:]]
            more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
            first = causes[paths[0]]
            also = f"; the same run or capture: {', '.join(names[:NAMED])}{more}"
            others = [causes.pop(path) for path in paths[1:]]
            causes[paths[0]] = _with(replace(first, message=first.message + also), others)


def _joined(findings: list[IntegrityFinding]) -> IntegrityFinding:
    """The findings of a path joined: an invalid signature first, then the first finding."""
    first = min(findings, key=lambda finding: finding.kind != SIGNATURE)
    return _with(first, [finding for finding in findings if finding is not first])


def _with(cause: IntegrityFinding, more: Iterable[IntegrityFinding]) -> IntegrityFinding:
    lines = [line for finding in more for line in (f"{finding.path}: {finding.message}", *finding.consequences)]
    return replace(cause, consequences=(*cause.consequences, *lines))


def _gone(causes: Mapping[str, IntegrityFinding], root: Place) -> dict[str, list[str]]:
    """Missing files by the topmost folder that is missing with them."""
    out: dict[str, list[str]] = {}
    there: dict[str, bool] = {}
    for path, finding in causes.items():
        if finding.kind != MISSING:
            continue
        parents = [str(parent) for parent in PurePosixPath(path).parents if str(parent) not in {".", *TOPS}]
        for folder in parents:
            if folder not in there:
                there[folder] = (root / folder).is_dir()
        gone = [folder for folder in parents if not there[folder]]
        if gone:
            out.setdefault(gone[-1], []).append(path)
    return out


TOPS = ("runs", "captures", "calibrations", "chain")


def _manifest_of(path: str) -> str:
    file = PurePosixPath(path)
    if file.suffix not in {".parquet", ".html"}:
        return ""
    return str(file.with_name("record.json") if file.parts[0] == "captures" else file.with_suffix(".json"))
