"""What the commands that judge models are given: dwells with their history, a model, effects from outside."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import pandas as pd


def dwells_and_history(source: str, history: str, archive: str | None) -> tuple[pd.DataFrame, pd.DataFrame | None]:
    """The dwells of a file or run, and their temperatures against time where there are any.

    Parameters
    ----------
    history : a file; empty for the run's own, or for the one that stands beside a file of dwells
    """
    from pipelines.cli.options import error_console
    from pipelines.importers.exchange import is_file, read_dwells, read_history

    dwells = read_dwells(source, archive=archive)
    if is_file(source) and not history:
        history = history_beside(source)
        if history:
            error_console().print(f"history: {history}, found beside the dwells", markup=False, soft_wrap=True)
    if history:
        return dwells, read_history(history, archive=archive)
    if is_file(source) or not _has_history(source, archive):
        return dwells, None
    return dwells, read_history(source, archive=archive)


def history_beside(source: str) -> str:
    """The history in the folder of a file of dwells: NAME-history, or history for a file called dwells; else empty."""
    from pathlib import Path

    dwells = Path(source)
    stems = [f"{dwells.stem}-history", f"{dwells.stem}_history"]
    if dwells.stem.endswith("dwells"):
        stems.append(f"{dwells.stem.removesuffix('dwells')}history")
    endings = dict.fromkeys((dwells.suffix, ".parquet", ".csv"))
    found = (dwells.with_name(stem + ending) for stem in stems for ending in endings)
    return next((str(path) for path in found if path.is_file()), "")


def judged_effects(source: str, archive: str | None, listed: str, model: Path | None, where: str) -> list[str] | None:
    """The model that a command judges: the one given, else a run's own; None where there is neither.

    Parameters
    ----------
    listed : effects as they were named on the command line; empty where they were not
    where : the command, for its messages
    """
    from pipelines.archive import Archive
    from pipelines.importers.exchange import is_file
    from pipelines.jobs.model_files import chosen_effects, use_formulas_of

    chosen = chosen_effects(listed, model, where)
    store = Archive(archive)
    if chosen or is_file(source) or not store.runs():
        return chosen
    run = store.run(source)
    use_formulas_of(run)
    return list(run.about.get("recipe", {}).get("effects", ())) or None


def _has_history(run: str, archive: str | None) -> bool:
    from pipelines.archive import Archive

    return "history" in Archive(archive).run(run).tables()


def add_effect_files(paths: Sequence[Path] | None) -> None:
    """Effects from files outside the tree, in the catalogue from now on."""
    from inertial import effects

    for path in paths or ():
        effects.add_file(path)


def both_runs(
    dwells: str, history: str, fresh: str, fresh_history: str, archive: str | None
) -> tuple[pd.DataFrame, pd.DataFrame | None, pd.DataFrame | None, pd.DataFrame | None]:
    """Dwells and history of a run, then those of the fresh one where it is named."""
    first, temperatures = dwells_and_history(dwells, history, archive)
    again, again_temperatures = dwells_and_history(fresh, fresh_history, archive) if fresh else (None, None)
    return first, temperatures, again, again_temperatures
