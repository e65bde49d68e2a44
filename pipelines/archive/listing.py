"""The list of the runs of an archive: one line for each run, read from as few files as possible."""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, fields
from typing import Annotated, Any

from pipelines.archive import derived, files
from pipelines.archive.keys import digest
from pipelines.archive.run import SEALED, Run, lost_files, names_in, stages_of
from pipelines.archive.store import ObjectPath, Place
from schemas.errors import ArchiveUnusable


@dataclass(frozen=True)
class RunInfo:
    """One line of the archive's list."""

    id: str
    recipe: str
    device: str
    units: tuple[str, ...]
    started: Annotated[str, "ISO date and time, UTC"]
    finished: bool
    stages: tuple[str, ...]
    station: Annotated[str, "its name; empty for an import"] = ""
    rerun_of: Annotated[str, "the run that it computes again; empty for others"] = ""
    passed: Annotated[int | None, "units that passed; null before the grades are there"] = None
    graded: Annotated[int | None, "units with a decision; null before the grades are there"] = None
    verdict: Annotated[str | None, "adequate, not adequate, not judged; null without a model to judge"] = None
    lost: Annotated[str, "files of a finished run that are not there, with commas between; empty where all are"] = ""


def info_of(run: Run) -> RunInfo | None:
    """The line of a run; None for a folder without a run."""
    names = names_in(run.path)
    if "run.json" not in names:
        return None
    about = run.about
    lot = about.get("lot", {})
    outcomes = _texts(run, names, GRADES, "outcome")
    return RunInfo(
        id=run.id,
        recipe=about.get("recipe", {}).get("name", about.get("name", "")),
        device=lot.get("device", ""),
        units=tuple(unit["serial"] for unit in lot.get("units", [])),
        started=about["when"],
        finished="report.html" in names or SEALED in names,  # a re-run is sealed without a report
        stages=tuple(_sealed_stages(run, names) or stages_of(run.path, names)),
        station=(about.get("station") or {}).get("name", ""),
        rerun_of=about.get("rerun_of") or "",
        passed=None if outcomes is None else outcomes.count("pass"),
        graded=None if outcomes is None else len(outcomes),
        verdict=next(iter(_texts(run, names, VERDICT, "verdict") or ()), None),
        lost=", ".join(lost_files(run.path, names)),
    )


def _texts(run: Run, names: set[str], table: str, column: str) -> list[str] | None:
    """A column of texts of a table; None where the table is not there, or cannot be read."""
    if f"{table}.parquet" not in names:
        return None
    import pyarrow as pa  # a list of runs without tables does without it
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(pa.BufferReader((run.path / f"{table}.parquet").read_bytes()))
        # without threads: a short command that ends while Arrow's threads start is aborted (1 of 360 presses of the tab key)
        return file.read(columns=[column], use_threads=False)[column].to_pylist()
    except (OSError, pa.ArrowInvalid, KeyError):  # 'tumbleline verify' says what is wrong with the file
        return None


def _sealed_stages(run: Run, names: set[str]) -> list[str]:
    """The stages in the seal of the run; none where the run has other manifests than its seal names."""
    if SEALED not in names:
        return []
    seal = files.read_json(run.path / SEALED)
    manifests = {name for name in names if name.endswith(".json") and name != SEALED}
    named = {name.rpartition("/")[2] for name in seal["files"] if name.startswith("runs/")}
    return seal.get("stages", []) if manifests == named else []


GRADES, VERDICT = "grades", "verdict"
FEWEST_NEW = 32  # reading fewer again is faster than writing the list
TICK_NS = 2_000_000_000
FINISHED = 1  # stamp of a finished run in an object store, whose folders have no time


def infos_of(root: Place, runs: Sequence[Run]) -> list[RunInfo]:
    """The lines of runs: from the list where it is up to date, else from their folders."""
    path = root / "index" / "list.json"
    known, state = stored_lines(path)
    if state == derived.EDITED:
        derived.warn_of_edits(path)
    stored, lines, new = dict[str, Any](), list[RunInfo](), 0
    for run in runs:
        before, stamp = known.get(run.id), stamp_of(run)
        if before is not None and before[0] == stamp and len(before[1]) == len(fields(RunInfo)):
            stored[run.id] = before
            lines.append(line_of(before[1]))
            continue
        info = info_of(run)
        if info is None:
            continue
        lines.append(info)
        if stamp is not None and (stamp != FINISHED or info.finished) and time.time_ns() - stamp > TICK_NS:
            stored[run.id], new = [stamp, astuple(info)], new + 1
    if new >= FEWEST_NEW or state == derived.EDITED:
        with suppress(ArchiveUnusable):  # a reader without write permission does without the list
            files.publish(path, files.json_bytes({"runs": stored, "seal": derived.seal({"runs": digest(stored)})}))
    return lines


def stamp_of(run: Run) -> int | None:
    """Time of the last change of the folder of a run, ns."""
    if isinstance(run.path, ObjectPath):
        return FINISHED
    try:
        return run.path.stat().st_mtime_ns
    except FileNotFoundError:
        return None


def stored_lines(path: Place) -> tuple[dict[str, Any], str]:
    """Stamp and line of every run in the list, and the state of its seal; no lines where the seal is not sound."""
    if not path.is_file():
        return {}, derived.SOUND
    try:
        content = files.read_json(path)
    except ArchiveUnusable:
        return {}, derived.EDITED
    lines = content.get("runs")
    if "seal" not in content or not isinstance(lines, dict):  # older versions wrote no seal
        return {}, derived.OTHERS
    state = derived.standing(content["seal"], {"runs": digest(lines)})
    return (lines if state == derived.SOUND else {}), state


def agrees(info: RunInfo, values: Sequence[Any]) -> bool:
    """Whether a stored line says what the files of its run say; one of an older version has fewer values."""
    stored = line_of(values)
    return astuple(info)[: len(values)] == astuple(stored)[: len(values)]


def line_of(values: Sequence[Any]) -> RunInfo:
    """A line of the list from its stored values."""
    run_id, recipe, device, units, started, finished, stages, *more = values
    return RunInfo(run_id, recipe, device, tuple(units), started, finished, tuple(stages), *more)
