"""The list of an archive's runs: of each what one line tells, from as few files as can be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from pipelines.archive import files

if TYPE_CHECKING:
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
        finished="report.html" in names or SEALED in names,  # a re-run is sealed without a report
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
