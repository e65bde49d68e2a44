"""Warm-up time with its uncertainty in white and 1/f noise: where a curve through the noise enters the band for good."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from inertial.arrays import Array
from inertial.dynamics.stability import short_noise, warm_up_time
from inertial.dynamics.wander import stated_error, variance_of_sum
from inertial.errors import NotIdentified

SPANS = (1.0, 2.0, 4.0, 8.0)  # windows on either side of the entry that the parabola spans
REACH = 3.0  # least span, in standard uncertainties of the time
ROUNDS = 20
SETTLED = 0.02  # of the span: a step of the crossing that ends the search
WIDEST = 0.9  # error of the level over the band, at 95 %: beyond it the late end is open
FEWEST = 5  # means under the parabola


@dataclass(frozen=True)
class WarmUpTime:
    """Time from power-on with its standard uncertainty and the ends of its 95 % interval, s."""

    value: float
    error: float
    low: float
    high: float


def entered(time: Array, record: Array, *, band: float, window_s: float) -> WarmUpTime:
    """Time at which the record enters ± band about its final value for good.

    The last excursion of a noisy record beyond the band comes late: by half a standard uncertainty where noise crosses it several
    times. So a parabola is laid through the record about the entry, over at least three standard uncertainties of the time on
    either side where eight windows are as much, and its crossing is taken. Its weights, and those of the final value, give the
    variance in white and 1/f noise.

    Parameters
    ----------
    time : (n,), s since power-on, evenly spaced
    record : (n,), any unit
    band : unit of the record
    window_s : shortest length over which the record is smoothed, s

    Raises
    ------
    NotIdentified
        The record leaves the band in its last fifth, or noise leaves the entry open.
    """
    last, final = warm_up_time(time, record, band=band, window_s=window_s)
    if last <= time[0]:
        return WarmUpTime(last, 0.0, last, last)  # within its band from the first mean on
    step, away = float(time[1] - time[0]), record - final
    noise = short_noise(record[len(record) // 2 :], 1.0 / step, trend=1)
    tail = np.zeros(len(record))
    tail[int(0.8 * len(record)) :] = 1.0
    tail /= tail.sum()
    best: WarmUpTime | None = None
    starts, reaches = [last, *(last - k * window_s for k in SPANS)], [SPANS[-1] * window_s]
    # the longest span first; then the shortest that holds the entry with its uncertainty, and settles
    for _ in range(2):
        # noise has left the band late: it crosses before
        tries = ((start, reach) for reach in reaches for start in starts)
        crossing = next((found for start, reach in tries if (found := _crossing(time, away, band, start, reach))), None)
        if crossing is None:
            break
        at, slope, weights, of_slope = crossing
        shares = weights - tail
        over = variance_of_sum(shares) / (2.0 * np.log(2.0))  # variance over F², h = F²/(2 ln 2)
        variance = noise.flicker * over + noise.white / step * float(np.sum(shares**2))
        steep = noise.flicker * variance_of_sum(of_slope) / (2.0 * np.log(2.0)) + noise.white / step * float(
            of_slope @ of_slope
        )
        error = stated_error(variance, over, noise.flicker_error, float(np.sqrt(steep)) / slope) / slope
        best = WarmUpTime(at, error, *_ends(at, error, band / slope, error * slope / band))
        starts, reaches = [at], [k * window_s for k in SPANS[:-1] if k * window_s >= REACH * error]
    if best is not None:
        return best
    raise NotIdentified(
        f"warm-up: noise of the output leaves open when it enters ± {band:.3g}, last seen outside at {last:.0f} s; lengthen "
        "window_s, or widen the band"
    )


def _ends(at: float, error: float, constant: float, share: float) -> tuple[float, float]:
    """Ends of the 95 % interval, s, of an entry whose curve settles with a local time constant ``constant``, s.

    Noise moves the level at which the curve crosses, and a settling curve is steeper above that level than below: an interval
    of equal arms is too short on the late side. The level errs by ``share`` of the band, one standard uncertainty.
    """
    wide = float(norm.ppf(0.975)) * share
    if wide >= WIDEST:
        return at - constant * float(np.log1p(wide)), at + float(norm.ppf(0.975)) * error / (1.0 - WIDEST)
    return at - constant * float(np.log1p(wide)), at - constant * float(np.log1p(-wide))


def _crossing(
    time: Array, away: Array, band: float, at: float, reach: float
) -> tuple[float, float, Array, Array] | None:
    """Crossing of a parabola over ± reach about itself, its slope there, and weights (n,) of the record in value and slope."""
    for _ in range(ROUNDS):
        near = np.flatnonzero(np.abs(time - at) <= reach)
        if near.size < FEWEST:
            return None
        inverse = np.linalg.pinv(np.vander(time[near] - at, 3))
        curve = inverse @ away[near]
        side = 1.0 if curve[2] >= 0.0 else -1.0
        roots = np.roots(curve - np.array([0.0, 0.0, side * band]))
        inside = roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) <= reach)]
        inside = inside[side * np.polyval(np.polyder(curve), inside) < 0.0]  # towards the final value
        if inside.size == 0:
            return None
        at += float(inside[0])
        if abs(inside[0]) < SETTLED * reach:
            weights, of_slope = np.zeros((2, len(time)))
            weights[near] = np.vander(inside[:1], 3)[0] @ inverse
            of_slope[near] = np.array([2.0 * inside[0], 1.0, 0.0]) @ inverse
            return at, float(abs(np.polyval(np.polyder(curve), inside[0]))), weights, of_slope
    return None
