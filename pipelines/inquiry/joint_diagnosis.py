"""The diagnosis of all runs of an inquiry together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from inertial.state import State
from pipelines.inquiry.lineage import RunSequence

if TYPE_CHECKING:
    from inertial.criticism.diagnosis import Diagnosis
    from pipelines.diagnosis.next_measurement import Proposed
    from pipelines.tables.dwells import Measured


@dataclass(frozen=True)
class JointDiagnosis:
    """The diagnosis of all runs of a lineage together."""

    lineage: RunSequence
    effects: tuple[str, ...]
    document: dict[str, Any]
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
