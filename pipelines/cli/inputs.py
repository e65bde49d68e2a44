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
    history : a file; empty for the run's own
    """
    from pipelines.importers.exchange import is_file, read_dwells, read_history

    dwells = read_dwells(source, archive=archive)
    if history:
        return dwells, read_history(history, archive=archive)
    if is_file(source) or not _has_history(source, archive):
        return dwells, None
    return dwells, read_history(source, archive=archive)


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
