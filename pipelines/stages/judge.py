"""The verdict on the model of a run: whether it is adequate, with residual, noise and probability; a table with one row."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits
from typing_extensions import TypedDict

from inertial import effects as catalogue
from inertial.errors import InertialError
from inertial.estimation.noise_shares import Shares
from pipelines.tables.frames import empty_table, rows_of
from pipelines.tables.sound_lot import error_of, every_unit_faulty, generator, sound_lot, told
from schemas.errors import DataRejected, RecipeInvalid
from schemas.tables import ADEQUATE, NOT_ADEQUATE, NOT_JUDGED

_TEXTS = {True: ADEQUATE, False: NOT_ADEQUATE, None: NOT_JUDGED}
_FIGURES = ("rms_ug", "floor_ug", "p_value")


class AdequacyDocument(TypedDict):
    """Whether the model of a run is adequate: the verdict of ``diagnose`` on the same run."""

    adequate: Annotated[bool | None, "null: cannot be judged, see `reason`"]
    reason: Annotated[str | None, "why it cannot be judged, with what is missing"]
    rms_ug: Annotated[float | None, "root mean square residual of the units without a data fault, µg"]
    floor_ug: Annotated[
        float | None, "noise of the measurement: what it leaves in the residuals of a correct model, µg"
    ]
    p_value: Annotated[float | None, "probability of such a residual if the model is adequate, at least 1e-300"]
    named: Annotated[bool, "whether an effect, a driver or an error of handling is found that the model lacks"]
    units: Annotated[int, "number of units that were judged"]
    faulty: Annotated[list[str], "units that were left out because of a data fault"]


def judge(dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str]) -> dict[str, pd.DataFrame]:
    """The table ``verdict`` of a run; without rows if the run has no model, as without a multi-position test."""
    if not effects:
        return {"verdict": verdict_table(None, effects)}
    verdict, shares = _judged(dwells, history, effects)
    table = verdict_table(verdict, effects)
    return {"verdict": table if shares is None else table.assign(flicker_share=shares.flicker, walk_share=shares.walk)}


def verdict_on(dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str]) -> AdequacyDocument:
    """The verdict of a diagnosis on a model, without classes and proposals; or the reason why it cannot be judged."""
    return _judged(dwells, history, effects)[0]


def shares_of(table: pd.DataFrame) -> Shares | None:
    """The shares of the noise that a table ``verdict`` holds; None where the model was not adequate or dwells were left out."""
    if table.empty or "flicker_share" not in table:
        return None
    return Shares(float(table["flicker_share"].iloc[0]), float(table["walk_share"].iloc[0]))


def _judged(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str]
) -> tuple[AdequacyDocument, Shares | None]:
    """The verdict, and the shares of the noise of an adequate model; None if dwells were left out or blocks have their own."""
    if dwells.empty:
        return _not_judged("every unit was refused, so that no dwell is left; see the reasons of each unit"), None
    from inertial.criticism.verdict import judged  # loads the search for effects: a run without dwells does not need it

    try:
        catalogue.get_all(list(effects))
        measurement, faults, lot = sound_lot(dwells, history, effects)
        faulty = sorted({measurement.units[fault.unit] for fault in faults})
        if lot is None:
            return _not_judged(every_unit_faulty(faults), faulty), None
        with threadpool_limits(1):
            verdict = judged(lot, effects, generator())
        error = error_of(verdict.rms, verdict.floor, verdict.log_p)
        adequate, reason, error = told(verdict.base, verdict.adequate, verdict.unjudged, error)
    except (DataRejected, RecipeInvalid, InertialError) as problem:
        return _not_judged(str(problem).rstrip(".")), None
    units = len(measurement.units) - len(faulty)
    shares = verdict.base.noise.shares
    if not adequate or verdict.handled or verdict.removed or shares.by_block:
        shares = None
    return _document(adequate, reason or None, error, verdict.found, units, faulty), shares


def told_by(diagnosis: Mapping[str, Any], units: int) -> AdequacyDocument:
    """The verdict from the document of a diagnosis of the same dwells and model; ``units``: number of units diagnosed."""
    faulty = sorted({unit for fault in diagnosis["blocked_by"] for unit in fault["units"]})
    adequate, error = diagnosis["adequate"], diagnosis["error"]
    named = bool(diagnosis["classes"] or diagnosis["unexplained"])
    judged = units - len(faulty) if adequate is not None or error["rms_ug"] is not None else 0
    return _document(adequate, diagnosis["reason"], error, named, judged, faulty)


def verdict_table(verdict: AdequacyDocument | None, effects: Sequence[str]) -> pd.DataFrame:
    """A verdict on a model as the table ``verdict``; without rows where there is none."""
    if verdict is None:
        return empty_table(
            texts="model verdict reason faulty", numbers=" ".join(_FIGURES), integers="units", flags="named"
        )
    row = {
        "model": ",".join(effects),
        "verdict": _TEXTS[verdict["adequate"]],
        "reason": verdict["reason"] or "",
        **{name: np.nan if verdict[name] is None else verdict[name] for name in _FIGURES},
        "named": verdict["named"],
        "units": verdict["units"],
        "faulty": ", ".join(verdict["faulty"]),
    }
    return pd.DataFrame([row])


def verdict_of(table: pd.DataFrame) -> AdequacyDocument | None:
    """The verdict of a table ``verdict``; None where it has no row."""
    if table.empty:
        return None
    (row,) = rows_of(table)
    error = {name: None if np.isnan(row[name]) else float(row[name]) for name in _FIGURES}
    adequate = {text: value for value, text in _TEXTS.items()}[str(row["verdict"])]
    faulty = str(row["faulty"]).split(", ") if row["faulty"] else []
    return _document(adequate, str(row["reason"]) or None, error, bool(row["named"]), int(row["units"]), faulty)


def _not_judged(reason: str, faulty: Sequence[str] = ()) -> AdequacyDocument:
    return _document(None, reason, dict.fromkeys(_FIGURES), False, 0, faulty)


def _document(
    adequate: bool | None,  # noqa: FBT001 - a value of the document
    reason: str | None,
    error: Mapping[str, float | None],
    named: bool,  # noqa: FBT001 - a value of the document
    units: int,
    faulty: Sequence[str],
) -> AdequacyDocument:
    return {
        "adequate": adequate,
        "reason": reason,
        "rms_ug": error["rms_ug"],
        "floor_ug": error["floor_ug"],
        "p_value": error["p_value"],
        "named": named,
        "units": units,
        "faulty": list(faulty),
    }
