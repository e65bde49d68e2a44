"""A run whose tables are read once: the stages of a re-run ask for the same ones, and what one made is what the next is given."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.archive import Run
from schemas import tables

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from pipelines.archive import Archive


class Remembering(Run):
    """A run that keeps its tables in memory, as they are in its files."""

    def __init__(self, archive: Archive, run_id: str) -> None:
        super().__init__(archive, run_id)
        self._known: dict[str, pd.DataFrame] = {}

    def table(self, name: str) -> pd.DataFrame:
        """A table of the run; whoever is given it may change it."""
        if name not in self._known:
            self._known[name] = super().table(name)
        return self._known[name].copy(deep=False)

    def save(self, stage: str, key: str, outputs: Mapping[str, pd.DataFrame], about: Mapping[str, Any]) -> None:
        """Publish the tables of a stage, and remember them with the types that they have in their files."""
        checked = {name: tables.check(name, frame, where=f"{stage} → {name}") for name, frame in outputs.items()}
        super().save(stage, key, checked, about)
        self._known |= {name: frame.reset_index(drop=True) for name, frame in checked.items()}
