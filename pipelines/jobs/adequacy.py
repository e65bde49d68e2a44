"""Whether the model of a run is adequate, as ``tumbleline diagnose RUN`` judges it, and the next step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import pandas as pd
from threadpoolctl import threadpool_limits
from typing_extensions import TypedDict

from inertial import effects as catalogue
from inertial.errors import InertialError
from pipelines.archive import Run
from pipelines.importers.exchange import dwells_of_run, history_of_run
from pipelines.jobs.model_files import use_formulas_of
from pipelines.tables.sound_lot import error_of, every_unit_faulty, generator, sound_lot
from schemas.errors import DataRejected, RecipeInvalid


class AdequacyDocument(TypedDict):
    """Whether the model of a run is adequate: the verdict of ``diagnose`` on the same run."""

    adequate: Annotated[bool | None, "null: cannot be judged, see `reason`"]
    reason: Annotated[str | None, "why it cannot be judged, with what is missing"]
    rms_ug: Annotated[float | None, "root mean square residual of the units without a data fault, µg"]
    floor_ug: Annotated[float | None, "noise of the measurement: white noise and wander between the dwells, µg"]
    p_value: Annotated[float | None, "probability of such a residual if the model is adequate, at least 1e-300"]
    named: Annotated[bool, "whether an effect, a driver or an error of handling is found that the model lacks"]
    units: Annotated[int, "number of units that were judged"]
    faulty: Annotated[list[str], "units that were left out because of a data fault"]


_judged: dict[tuple[str, ...], AdequacyDocument] = {}
"""The verdict on the last run: report and last line of one command need it once."""


def adequacy_of(run: Run) -> AdequacyDocument | None:
    """The verdict on the model of a run; None where it has no multi-position test, or was not captured.

    No table holds it: a run of an earlier version is judged as a new one is.
    """
    about, tables = run.about, run.tables()
    recipe = about.get("recipe", {})
    if not (about.get("capture") and "dwells" in tables and recipe.get("poses") and recipe.get("effects")):
        return None
    parts = [name for name in ("dwells", "history") if name in tables]
    formulas = [str(formula) for formula in recipe.get("formulas", ())]
    key = (*(run.manifest(name)["sha256"] for name in parts), *recipe["effects"], *formulas)
    if key not in _judged:
        verdict = _verdict_on(run, recipe["effects"], with_history="history" in parts)
        _judged.clear()
        _judged[key] = verdict
    return _judged[key]


def _verdict_on(run: Run, effects: Sequence[str], *, with_history: bool) -> AdequacyDocument:
    """The verdict; where the data or an effect are not usable, the reason."""
    try:
        use_formulas_of(run)
        dwells = dwells_of_run(run)
        if dwells.empty:
            return _not_judged("every unit was refused, so that no dwell is left; see the reasons of each unit")
        return adequacy(dwells, history_of_run(run) if with_history else None, effects)
    except (DataRejected, RecipeInvalid, InertialError) as problem:
        return _not_judged(str(problem).rstrip("."))


def adequacy(dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str]) -> AdequacyDocument:
    """The verdict of dwells on a model: what a diagnosis says of it, without classes, drivers and proposals.

    Raises
    ------
    DataRejected
        There are no dwells, or too few to judge anything.
    InertialError
        An effect is unknown, or the dwells lack a quantity of the model.
    """
    from inertial.criticism.verdict import judged  # loads the search for effects: a run without dwells does not need it

    catalogue.get_all(list(effects))
    measurement, faults, lot = sound_lot(dwells, history, effects)
    faulty = sorted({measurement.units[fault.unit] for fault in faults})
    if lot is None:
        return _not_judged(every_unit_faulty(faults), faulty)
    with threadpool_limits(1):
        verdict = judged(lot, effects, generator())
    error = error_of(verdict)
    return {
        "adequate": verdict.adequate,
        "reason": verdict.unjudged or None,
        "rms_ug": error["rms_ug"],
        "floor_ug": error["floor_ug"],
        "p_value": error["p_value"],
        "named": verdict.named,
        "units": len(measurement.units) - len(faulty),
        "faulty": faulty,
    }


def _not_judged(reason: str, faulty: Sequence[str] = ()) -> AdequacyDocument:
    return {
        "adequate": None,
        "reason": reason,
        "rms_ug": None,
        "floor_ug": None,
        "p_value": None,
        "named": False,
        "units": 0,
        "faulty": list(faulty),
    }
