"""Dwells as the lot that a verdict on a model rests on: long runs reduced, units with a data fault left out."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.counts import number_of
from inertial.criticism.contradicted_poses import contradiction
from inertial.criticism.few_dwells import REASON, contradicted
from inertial.data_errors.faults import Fault, find_faults, missing_dwells, names_of_missing
from inertial.decisions import ADEQUATE_ABOVE
from inertial.errors import InertialError
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot
from pipelines.tables.condense import condense
from pipelines.tables.dwells import Measured, lot_of, measured
from schemas.errors import DataRejected
from schemas.units import MICRO

SMALL_MISFIT = "the misfit is smaller than the noise, but significant"
_SMALL = 1.1
_SHOWN = 6  # units, and dwells of each, that a notice of missing dwells lists
_SEED = 1293


def generator() -> np.random.Generator:
    """Draws the noise that adequacy is compared with: the same data give the same result."""
    return np.random.default_rng(_SEED)


def sound_lot(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], left_out: Collection[str] = ()
) -> tuple[Measured, list[Fault], Lot | None]:
    """Readings, data faults, and the lot of the units without a fault, g; no lot where every unit has a fault.

    Parameters
    ----------
    dwells, history : exchange format
    effects : the model to judge
    left_out : ``UNIT:DWELL``, removed from ``dwells`` on purpose, so that it is no fault if a unit lacks them

    Raises
    ------
    DataRejected
        There are no dwells, or too few to judge anything.
    """
    measurement = measured(condense(dwells), history)
    faults = find_faults(measurement.readings) if measurement.reference != "norm" else []
    numbers = [int(number) for number in measurement.dwells]
    unmeant = [fault for fault in faults if not _on_purpose(measurement, fault, left_out)]
    faults = [fault.named(measurement.units, numbers) for fault in unmeant]
    blocked = {f.unit for f in faults}
    sound = [u for u in range(len(measurement.units)) if u not in blocked]
    try:
        # two threads on small matrices wait for each other: on a busy machine it takes sixty times as long
        with threadpool_limits(1):
            if not sound and not contradiction(lot_of(measurement))[0]:
                return measurement, faults, None
            if not sound:  # responses to wrong poses say nothing about the units
                faults, blocked = [], set[int]()
            picked = measurement.pick(sound) if blocked else measurement
            return measurement, faults, lot_of(picked, square="misalignment" not in effects)
    except InertialError as problem:
        raise DataRejected(str(problem)) from None


def _on_purpose(measurement: Measured, fault: Fault, left_out: Collection[str]) -> bool:
    """Whether a fault is only that dwells were left out."""
    named = {f"{measurement.units[fault.unit]}:{int(measurement.dwells[k])}" for k in fault.dwells}
    return fault.name in names_of_missing() and bool(named) and named <= set(left_out)


def gaps(measurement: Measured, faults: Sequence[Fault], left_out: Collection[str] = ()) -> list[str]:
    """A notice of the dwells that units without a fault lack and others have: they are judged by the dwells they have.

    Of those that were left out on purpose (``UNIT:DWELL``) nothing is said.
    """
    faulty = {fault.unit for fault in faults}
    parts: list[str] = []
    for index, unit in enumerate(measurement.units):
        missing = (int(measurement.dwells[k]) for k in missing_dwells(measurement.readings, index))
        numbers = [n for n in missing if f"{unit}:{n}" not in left_out]
        if numbers and index not in faulty:
            shown = ", ".join(map(str, numbers[:_SHOWN])) + (", …" if len(numbers) > _SHOWN else "")
            parts.append(f"{unit} {len(numbers)} ({shown})")
    if not parts:
        return []
    more = f" and {number_of(len(parts) - _SHOWN, 'more unit')}" if len(parts) > _SHOWN else ""
    text = ", ".join(parts[:_SHOWN]) + more
    return [f"of {len(measurement.dwells)} dwells of the lot are missing: {text}; these units are judged by the others"]


def every_unit_faulty(faults: Sequence[Fault]) -> str:
    """The reason why a lot without a sound unit cannot be judged."""
    return f"every unit ({len({f.unit for f in faults})}) has a data fault; correct the faults, then judge the model"


def probability(log_p: float) -> float:
    """A probability; values below the smallest number are given as that."""
    return float(max(np.exp(min(log_p, 0.0)), 1e-300))


def error_of(rms: float, floor: float, log_p: float) -> dict[str, Any]:
    """Residual and noise, µg, from g, and the probability of such a residual, from its natural logarithm."""
    return {"rms_ug": MICRO * rms, "floor_ug": MICRO * floor, "p_value": probability(log_p)}


def is_small(error: Mapping[str, Any]) -> bool:
    """Whether an error is significant by its ``p_value``, but so near the noise that it can be mistaken for it.

    A model that is not adequate only because of faults of the data leaves no significant error beside them.
    """
    return bool(error["rms_ug"] < _SMALL * error["floor_ug"] and error["p_value"] <= ADEQUATE_ABOVE)


class Told(NamedTuple):
    """A verdict: whether the model is adequate, why it cannot be judged or is not adequate, and the error behind it, µg."""

    adequate: bool | None
    reason: str
    error: dict[str, Any]


def told(base: Model, adequate: bool | None, unjudged: str, error: dict[str, Any]) -> Told:  # noqa: FBT001 - a verdict
    """The verdict of a diagnosis, or that of the samples where there are too few dwells for one."""
    against = None if adequate is not None else contradicted(base)
    if against is None:
        return Told(adequate, unjudged, error)
    return Told(False, REASON, {**error, **error_of(*against)})
