"""As found and as left: the readings of today corrected with the earlier coefficients and with the new ones."""

from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.correction import correct
from inertial.design import carried_over, of_axes
from pipelines.archive import Run
from pipelines.certificates import Calibration
from pipelines.certificates.document.content import Adjustment
from pipelines.stages.verify import sizes
from pipelines.tables.calibration import read_calibration
from pipelines.tables.dwells import lot_arrays
from schemas.errors import TumblelineError
from schemas.units import MICRO


def adjustment(run: Run, calibration: Calibration, known: list[Calibration]) -> Adjustment:
    """Error of the norm of gravity of the readings of a calibration, with the coefficients as found and as left.

    The norm needs no angle: a unit that sits otherwise in the fixture than before has no error by that.

    Parameters
    ----------
    known : calibrations of the unit in the ledger, in order. One that was revoked after this was issued was good on that day:
        the same certificate says the same whenever it is written.
    """
    before = [
        other
        for other in known
        if other.event.sequence < calibration.event.sequence
        and other.run != run.id
        and other.event.table == "coefficients"
        and not (other.state == "revoked" and other.ended_by and other.ended_by.sequence < calibration.event.sequence)
    ]
    if not before:
        return Adjustment(earlier="", earlier_date="", text="no earlier calibration of this unit is in the archive")
    last = before[-1]
    old = Run(run.archive, last.run)
    head: dict[str, Any] = {"earlier": last.certificate, "earlier_date": last.event.when[:10]}
    try:
        if old.manifest("coefficients")["sha256"] != last.event.coefficients:
            return Adjustment(**head, text="not evaluated: the earlier coefficients are not those that were certified")
        found, left = _errors(run, old, last.serial), _errors(run, run, last.serial)
    except TumblelineError as problem:
        return Adjustment(**head, text=f"not evaluated: {problem}")
    return Adjustment(
        **head,
        text="the readings of this calibration, corrected with the coefficients of the earlier certificate (as found) and with "
        "those of this certificate (as left)",
        dwells=found.size,
        found_rms_ug=_rms(found), found_max_ug=float(np.max(np.abs(found))),
        left_rms_ug=_rms(left), left_max_ug=float(np.max(np.abs(left))),
    )  # fmt: skip


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _errors(run: Run, source: Run, unit: str) -> Array:
    """| |a| − g | of a run's dwells, (n,), µg, with the coefficients of another run; verification dwells where there are any."""
    dwells, coefficients, covariance = run.table("dwells"), source.table("coefficients"), source.table("covariance")
    history = run.table("history") if "history" in run.tables() else None
    rows = dwells[dwells["unit"] == unit]
    past = None if history is None else history[history["unit"] == unit]
    lot = lot_arrays(rows, past)
    calibration = read_calibration(*(table[table["unit"] == unit] for table in (coefficients, covariance)))
    corrected = correct(
        calibration.effects, lot.state, lot.output, calibration.coefficients, carried_over(calibration.nonlinear)
    )
    axes = lot.state.axes
    error = MICRO * (sizes(of_axes(corrected, axes, -1)) - sizes(of_axes(lot.state.force, axes, -1)))
    unseen = lot.of_kind("verification")
    return error.reshape(-1)[unseen] if unseen.any() else error.reshape(-1)
