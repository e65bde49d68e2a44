"""The bias as three measurands, each with its standard uncertainty: mean of the record, mean of a day, next switch-on."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.noise.flicker import SLOWEST_FITTED, constants_of
from inertial.noise.measurands import DAY_S, against_mean, flicker_mean, instability, of_a_day, walk_mean

COLUMNS = (
    *("bias_instability_ug", "bias_record_u_ug", "bias_long_u_ug", "bias_long_s", "bias_switch_on_u_ug"),
    "bias_walk_ug_rts",
)


@dataclass(frozen=True)
class BiasNoise:
    """Bias and noise of a fit; arrays (units, 3), µg.

    error : standard error of the coefficient, the walk counted from its mean over the record
    gain : (units, 3, n), what every dwell of the fit adds to the coefficient
    flicker : standard deviation of the wander between dwells
    carried : that of the random walk that goes on after the record, at the end of all dwells
    excess : scatter of the dwells that their samples do not show, and what of the walk is not carried on
    time : (n,), s, of the dwells of the fit; every : (m,), s, of all dwells: the walk is zero at the first of them
    known : factor of the errors, as the noise is known from few degrees of freedom; widened : of the flicker after the record
    """

    error: Array
    gain: Array
    flicker: Array
    carried: Array
    excess: Array
    time: Array
    every: Array
    known: float
    widened: float


def bias_measurands(noise: BiasNoise) -> dict[str, Array]:
    """Standard uncertainties of the bias by measurand, (units, 3) each, by the names of :data:`COLUMNS`.

    ``record``: the mean over the dwells' own time, which the coefficient follows: what both share of the wander is no error.
    ``long``: the mean over the day after it; flicker and random walk until then are added. ``switch_on``: the mean of a day after
    the device was switched off and on; not a number, never zero, since a record does not show how switching on repeats. The last
    column is no uncertainty but the coefficient K of the random walk that goes on after the record, µg/√s.
    """
    time, first, start = noise.time, float(noise.time.min()), float(noise.every.min())
    length = float(np.ptp(time))
    square = noise.error**2
    if length > 0.0:
        flicker = flicker_mean(time, constants_of(noise.every, slowest=SLOWEST_FITTED), first, length)
        walk = _of_variance_one(walk_mean(time, start, first, length), noise)
        day = _of_variance_one(walk_mean(time, start, first + length, DAY_S), noise)
        square = square + noise.known**2 * against_mean(noise.flicker**2, noise.gain, flicker)
        # the fit counts the walk from its mean over the record: of the record's mean its error is none
        goes_on = against_mean(noise.carried**2, noise.gain, day) - against_mean(noise.carried**2, noise.gain, walk)
        later = square + noise.known**2 * goes_on
    else:
        later = square
    record, at_end = (np.sqrt(np.maximum(part, 0.0)) for part in (square, later))
    wander = np.hypot(noise.flicker, noise.excess)
    long = of_a_day(at_end, wander, time, widened=noise.widened)
    again = np.full_like(record, np.nan)
    walk = noise.carried / np.sqrt(max(float(np.ptp(noise.every)), 1e-9))
    values = (instability(wander, time), record, long, np.full_like(record, DAY_S), again, walk)
    return dict(zip(COLUMNS, values, strict=True))


def _of_variance_one(kind: tuple[Array, float], noise: BiasNoise) -> tuple[Array, float]:
    """Covariance and variance of a random walk whose variance is 1 at the end of all dwells."""
    span = max(float(np.ptp(noise.every)), 1e-9)
    return kind[0] / span, kind[1] / span
