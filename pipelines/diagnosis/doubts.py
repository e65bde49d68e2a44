"""What speaks against a verdict from one run alone: a fault of the run, or a remainder, that the effects may imitate."""

from __future__ import annotations

from collections.abc import Sequence

from inertial.criticism.diagnosis import diagnose
from inertial.criticism.verdict import judged
from inertial.data_errors.bad_dwells import BadDwell
from inertial.data_errors.faults import find_faults
from inertial.errors import InertialError
from inertial.estimation.problem import Lot
from pipelines.diagnosis.result_rows import BAD_DWELL
from pipelines.tables.dwells import Measured
from pipelines.tables.sound_lot import generator


def doubt_of_run(measurement: Measured, lot: Lot, before: Sequence[str], after: Sequence[str]) -> str | None:
    """Why one run cannot tell the added effects from a fault of the run, as text; None if nothing speaks for a fault.

    A fault (a table that slipped, units exchanged, a thermometer) lies in the dwells that are left out as in the others, so
    that what imitates it predicts them. The run is therefore searched for faults without and with the effects, and the model
    with them has to be adequate.

    Parameters
    ----------
    measurement, lot : the run; before, after : ids of the models without and with the effects
    """
    faults = find_faults(measurement.readings) if measurement.reference != "norm" else []
    if faults:
        return f"the run has a data fault: {_listed([fault.name for fault in faults])}"
    try:
        return _with_effects(lot, after) or _without_effects(lot, before)
    except InertialError as problem:
        return f"the run cannot be searched for faults: {problem}"


def _with_effects(lot: Lot, after: Sequence[str]) -> str | None:
    verdict = judged(lot, after, generator())
    named = [name for one in verdict.run.handled for name in one.effects.ids] + _bad(verdict.removed)
    if named:
        return f"with it the diagnosis of the run names {_listed(named)}"
    if verdict.adequate is True:
        return None
    return f"the model with it is not adequate for the run{f': {verdict.unjudged}' if verdict.unjudged else ''}"


def _without_effects(lot: Lot, before: Sequence[str]) -> str | None:
    first = diagnose(lot, before, generator())
    # a handling error in the class of an effect explains the run as well as the effect
    groups = [one.effects for one in (*first.handled, *first.named) if one.effects.of_data]
    named = [name for group in groups for name in group.ids] + _bad(first.removed)
    return f"without it the diagnosis of the run names {_listed(named)}" if named else None


def _bad(removed: Sequence[BadDwell]) -> list[str]:
    return [BAD_DWELL for dwell in removed if not dwell.tail]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(dict.fromkeys(names))
