"""The bias as three measurands, each with its standard uncertainty: mean of the record, mean of a day, next switch-on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial.noise.measurands import DAY_S, instability, of_a_day, of_the_record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

COLUMNS = ("bias_instability_ug", "bias_record_u_ug", "bias_long_u_ug", "bias_long_s", "bias_switch_on_u_ug")


def bias_measurands(
    record: Array,
    wander: Array,
    walk: Array,
    time: Array,
    widened: float,
    switch_on: float | None = None,
) -> dict[str, Array]:
    """Standard uncertainties of the bias by measurand, (units, 3) each, by the names of :data:`COLUMNS`.

    ``record``: the mean over the dwells' own time: the standard error of the coefficient, and what a walk adds, as the
    coefficient is its value at the first dwell. ``long``: the mean over the day after it; flicker and random walk until then
    are added. ``switch_on``: the mean of a day after the device was switched off and on; not a number where no repeatability of
    switching on is stated, never zero.

    Parameters
    ----------
    record : (units, 3), µg, standard error of the coefficient; wander : (units, 3), µg, standard deviation of the 1/f wander
    between dwells
    walk : (units, 3), µg, standard deviation of the random walk at the end of the record
    time : (n,), s, of the dwells of the fit
    widened : factor on the share of the wander, for its few degrees of freedom
    switch_on : standard deviation of the bias from one switch-on to the next, µg
    """
    found, long = instability(wander, time), of_a_day(record, wander, time, walk=walk, widened=widened)
    again = np.full_like(record, np.nan) if switch_on is None else np.hypot(long, switch_on)
    return dict(
        zip(COLUMNS, (found, of_the_record(record, walk), long, np.full_like(record, DAY_S), again), strict=True)
    )
