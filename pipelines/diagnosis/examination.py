"""A diagnosis with all its results: the document for programs, the readings, the search."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from threadpoolctl import threadpool_limits

from inertial import effects as catalogue
from inertial.criticism.diagnosis import Diagnosis
from inertial.planning.reasons import reason
from pipelines.diagnosis.diagnose import default_model, document, examined
from pipelines.diagnosis.suggested_formula import as_toml, offer
from pipelines.parallel import keep_memory
from pipelines.tables.dwells import Measured


@dataclass(frozen=True)
class Examination:
    """A diagnosis of dwells.

    document : for programs, with keys beyond the fixed ones
    measured, diagnosis : the readings, and their diagnosis; None if every unit has a data fault
    """

    document: dict[str, Any]
    measured: Measured
    diagnosis: Diagnosis | None


def examination(
    table: pd.DataFrame,
    history: pd.DataFrame | None,
    judged: Sequence[str] | None,
    left_out: Collection[str] = (),
) -> Examination:
    """The diagnosis of dwells against a model, on one thread: the matrices are small.

    Parameters
    ----------
    judged : the model; the default one if None
    left_out : ``UNIT:DWELL``, which were removed from ``table`` on purpose
    """
    effects = list(judged) if judged else default_model(table)
    keep_memory()
    with threadpool_limits(1):
        measurement, faults, diagnosis = examined(table, history, effects, left_out)
        content = {
            **document(measurement, faults, diagnosis, left_out=left_out),
            **report_fields(measurement.units, effects, diagnosis),
        }
    return Examination(content, measurement, diagnosis)


def report_fields(units: tuple[str, ...], effects: list[str], diagnosis: Diagnosis | None) -> dict[str, Any]:
    """Keys of the document beyond the fixed ones: the judged model, breakers of unseen effects, the suggested formula."""
    extras: dict[str, Any] = {"effects": effects, "units": list(units), "breakers": {}, "offer": None}
    if diagnosis is None:
        return extras
    extras["breakers"] = {name: catalogue.get(name).breaker for name in diagnosis.unseen}
    state = diagnosis.problem.lot.state
    extras["reasons"] = {name: reason(state, name, effects) for name in diagnosis.unseen}
    if diagnosis.unexplained is not None:
        formula = offer(diagnosis.unexplained, diagnosis.problem.lot.state)
        extras["offer"] = None if formula is None else {**formula, "toml": as_toml(formula)}
    return extras
