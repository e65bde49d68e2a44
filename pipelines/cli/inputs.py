"""Inputs of the commands that judge models: dwells with their history, effects of the user."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.archive import Archive
from pipelines.cli.printing import remark
from schemas.foreign import is_file

if TYPE_CHECKING:
    import pandas as pd

    from pipelines.parallel import Distributor
    from schemas.lot import Lot


def dwells_and_history(source: str, history: str, archive: str | None) -> tuple[pd.DataFrame, pd.DataFrame | None]:
    """The dwells of a file or run, and their temperatures against time where there are any.

    history : a file; empty for the history of the run, or for the file beside a file of dwells
    """
    from pipelines.diagnosis import inputs

    dwells, temperatures, file = inputs.dwells_and_history(source, history, archive)
    if file and not history:
        remark(f"history: {file}, found beside the dwells")
    return dwells, temperatures


def start_reader(*sources: str) -> None:
    """Start the process that reads files, where one is named, while this process imports the libraries of its command."""
    from pipelines.importers import limited

    if any(is_file(source) for source in sources if source):
        limited.start()


def without_dwells(dwells: pd.DataFrame, listed: str) -> tuple[pd.DataFrame, list[str]]:
    """The dwells without those that an option lists as UNIT:DWELL, divided by commas; and these, one by one."""
    from pipelines.tables.leave_out import leave_out, named_dwells

    named = named_dwells(listed)
    return leave_out(dwells, named), [f"{unit}:{dwell}" for unit, dwell in named]


def add_effects(files: Sequence[Path] | None, formulas: Sequence[str] | None = None, where: str = "") -> None:
    """Effects from files outside the tree, and formulas of the command line, in the catalogue from now on."""
    from inertial import effects

    for path in files or ():
        effects.add_file(path)
    if formulas:
        from pipelines.diagnosis.inputs import use_written_formulas

        use_written_formulas(formulas, where)


def distribution(store: Archive, runs: Sequence[str], dask: str, workers: int | None) -> tuple[Distributor | None, int]:
    """The function that distributes work over Dask, None for processes of this machine; and the number of processes."""
    from pipelines.flows.dask_cluster import on_dask
    from pipelines.parallel import processors

    count = max(1, min(workers or processors(), len(runs)))
    home = store.root.resolve() / "orchestrator" if isinstance(store.root, Path) else None
    return on_dask(dask, count, home), count


def both_runs(
    dwells: str, history: str, fresh: str, fresh_history: str, archive: str | None
) -> tuple[pd.DataFrame, pd.DataFrame | None, pd.DataFrame | None, pd.DataFrame | None]:
    """Dwells and history of a run, then those of the fresh run where it is named."""
    first, temperatures = dwells_and_history(dwells, history, archive)
    again, again_temperatures = dwells_and_history(fresh, fresh_history, archive) if fresh else (None, None)
    return first, temperatures, again, again_temperatures


def made_up(device: str, units: int, seed: int, repeat: int = 0) -> Lot:
    """A lot with generated serial numbers, one per slot."""
    from schemas.lot import Lot, Unit

    sitting = [Unit(serial=f"SIM{i:04d}", slot=i) for i in range(units)]
    return Lot(units=sitting, device=device, seed=seed, repeat=repeat)
