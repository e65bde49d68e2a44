"""Inputs of the commands that judge models: dwells with their history, a model, effects of the user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


def dwells_and_history(source: str, history: str, archive: str | None) -> tuple[pd.DataFrame, pd.DataFrame | None]:
    """The dwells of a file or run, and their temperatures against time where there are any.

    Parameters
    ----------
    history : a file; empty for the run's own, or for the one beside a file of dwells
    """
    from pipelines.cli.options import error_console
    from pipelines.diagnosis import inputs

    dwells, temperatures, place = inputs.dwells_and_history(source, history, archive)
    if place and not history:
        error_console().print(f"history: {place}, found beside the dwells")
    return dwells, temperatures


def judged_effects(source: str, archive: str | None, listed: str, model: Path | None, where: str) -> list[str] | None:
    """The model that a command judges: the one given, else a run's own; None where there is neither.

    Parameters
    ----------
    listed : effects as they were named on the command line; empty where they were not
    where : the command, for its messages
    """
    from pipelines.diagnosis import inputs

    return inputs.judged_effects(source, archive, listed, model, where)


def without_dwells(dwells: pd.DataFrame, listed: str) -> tuple[pd.DataFrame, list[str]]:
    """The dwells without those that an option lists as UNIT:DWELL, divided by commas; and these, one by one."""
    from pipelines.tables.leave_out import leave_out, named_dwells

    named = named_dwells(listed)
    return leave_out(dwells, named), [f"{unit}:{dwell}" for unit, dwell in named]


def add_formulas(written: Sequence[str] | None, where: str) -> None:
    """Formulas of the command line, in the catalogue from now on."""
    if written:
        from pipelines.diagnosis import inputs

        inputs.use_written_formulas(written, where)


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
