"""The list of an archive's runs: of each what one line tells, from as few files as can be."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.store import ObjectPath
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.archive.run import Run
    from pipelines.archive.store import Place

SEALED = "sealed.json"


@dataclass(frozen=True)
class RunInfo:
    """One line of the archive's list."""

    id: str
    recipe: str
    device: str
    units: tuple[str, ...]
    started: str
    finished: bool
    stages: tuple[str, ...]


def info_of(run: Run) -> RunInfo | None:
    """The line of a run; None for a folder in which none was begun yet."""
    names = _names(run.path)
    if "run.json" not in names:
        return None
    about = run.about
    lot = about.get("lot", {})
    return RunInfo(
        id=run.id,
        recipe=about.get("recipe", {}).get("name", about.get("name", "")),
        device=lot.get("device", ""),
        units=tuple(unit["serial"] for unit in lot.get("units", [])),
        started=about["when"],
        finished="report.html" in names,
        stages=tuple(_sealed_stages(run, names) or stages_of(run, names)),
    )


def stages_of(run: Run, names: set[str] | None = None) -> list[str]:
    """The stages that made the run's tables."""
    names = _names(run.path) if names is None else names
    tables = sorted(name.removesuffix(".parquet") for name in names if name.endswith(".parquet"))
    made = (
        str(files.read_json(run.path / f"{name}.json").get("stage", "")) for name in tables if f"{name}.json" in names
    )
    return list(dict.fromkeys(made))


def _sealed_stages(run: Run, names: set[str]) -> list[str]:
    """The stages as they were noted when the run was sealed; none where it has other manifests by now."""
    if SEALED not in names:
        return []
    noted = files.read_json(run.path / SEALED)
    there = {name for name in names if name.endswith(".json") and name != SEALED}
    named = {name.rpartition("/")[2] for name in noted["files"] if name.startswith("runs/")}
    return noted.get("stages", []) if there == named else []


def _names(folder: Place) -> set[str]:
    return {place.name for place in folder.iterdir()} if folder.is_dir() else set()


FEWEST_NEW = 32  # fewer are read again sooner than they are written
TICK_NS = 2_000_000_000
FINISHED = 1  # the stamp of a finished run where folders have no time


def infos_of(root: Place, runs: Sequence[Run]) -> list[RunInfo]:
    """The lines of runs, read from their folders where they are not noted."""
    place = root / "index" / "list.json"
    known, noted, found, new = _noted(place), dict[str, Any](), list[RunInfo](), 0
    for run in runs:
        before, stamp = known.get(run.id), _stamp(run)
        if before is not None and before[0] == stamp:
            noted[run.id] = before
            found.append(_line(before[1]))
            continue
        info = info_of(run)
        if info is None:
            continue
        found.append(info)
        if stamp is not None and (stamp != FINISHED or info.finished) and time.time_ns() - stamp > TICK_NS:
            noted[run.id], new = [stamp, astuple(info)], new + 1
    if new >= FEWEST_NEW:
        with suppress(ArchiveUnusable):  # who may only read the archive reads it without
            files.publish(place, files.json_bytes({"runs": noted}))
    return found


def _stamp(run: Run) -> int | None:
    """When the run's folder was last written to, ns."""
    if isinstance(run.path, ObjectPath):
        return FINISHED
    try:
        return run.path.stat().st_mtime_ns
    except FileNotFoundError:
        return None


def _noted(place: Place) -> dict[str, Any]:
    try:
        return files.read_json(place).get("runs", {}) if place.is_file() else {}
    except ArchiveUnusable:  # half of something that nobody needs
        return {}


def _line(noted: Sequence[Any]) -> RunInfo:
    run_id, recipe, device, units, started, finished, stages = noted
    return RunInfo(run_id, recipe, device, tuple(units), started, finished, tuple(stages))
