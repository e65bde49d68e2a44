"""A run and its follow-ups as one set of dwells, and their diagnosis together: one station, one lot, one clock."""

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from inertial.criticism.diagnosis import Diagnosis
from inertial.state import State
from pipelines.archive import Run
from pipelines.diagnosis.documents import DiagnosisDocument
from pipelines.diagnosis.next_measurement import Proposed
from pipelines.tables.dwells import Measured
from schemas.errors import DataRejected

NUMBERED = ("dwell", "record")


@dataclass(frozen=True)
class RunSequence:
    """A first run and its follow-ups, in order."""

    runs: tuple[Run, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.id for run in self.runs)

    def dwells(self) -> pd.DataFrame:
        """Dwells of all runs, numbered consecutively, without units that a run refused."""
        tables = [run.table("dwells") for run in self.runs]
        accepted = set.intersection(*(set(table["unit"].astype(str)) for table in tables))
        if not accepted:
            raise DataRejected(self._refused())
        return _numbered_through([table[table["unit"].isin(accepted)] for table in tables])

    def _refused(self) -> str:
        """Message for a lineage without a unit that all runs accepted."""
        verdicts = self.runs[-1].table("verdicts")
        reasons = verdicts.loc[verdicts["refused"], "reason"].astype(str).unique().tolist()
        why = f" ({reasons[0]})" if reasons else ""
        return (
            f"investigate: no unit was accepted by all of {', '.join(self.ids)}, at least one is needed; the last refused "
            f"{int(verdicts['refused'].sum())} of {len(verdicts)}{why}; correct the cause and investigate a new run"
        )

    def history(self) -> pd.DataFrame:
        """Temperatures against time through all runs."""
        return pd.concat([run.table("history") for run in self.runs], ignore_index=True)

    def minutes(self) -> list[float]:
        """Station time of each run, min."""
        readings = [run.table("readings") for run in self.runs]
        ends = [
            float((reading["start_s"] + reading["duration_s"]).max()) for reading in readings
        ]  # on the station's clock
        return [(end - begin) / 60.0 for begin, end in zip([0.0, *ends], ends, strict=False)]


@dataclass(frozen=True)
class JointDiagnosis:
    """The diagnosis of all runs of a lineage together."""

    lineage: RunSequence
    document: DiagnosisDocument
    measured: Measured
    diagnosis: Diagnosis | None
    following: Proposed

    @property
    def state(self) -> State:
        """The dwells of the diagnosis."""
        if self.diagnosis is None:
            raise LookupError("an inquiry in which every unit has a data fault has no state")
        return self.diagnosis.problem.lot.state

    @property
    def ambiguous(self) -> list[list[str]]:
        """Classes of more than one effect."""
        return [group["effects"] for group in self.document["classes"] if len(group["effects"]) > 1]


def _numbered_through(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Concatenated tables; the numbers of dwells and soaks continue from table to table."""
    numbered: list[pd.DataFrame] = []
    for table in tables:
        shifted = table.copy()
        for column in (*NUMBERED, "soak"):
            if numbered and column in table.columns:
                shifted[column] = table[column] + 1 + max(int(before[column].max()) for before in numbered)
        numbered.append(shifted)
    return pd.concat(numbered, ignore_index=True)
