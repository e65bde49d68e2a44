"""Figures of a recorded step response: overshoot, settling time into a band, rise time and delay, with uncertainties."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.errors import NotIdentified

ALIGNMENTS = 3
FEWEST = 7  # points of a local fit
CENTRINGS = 3  # fits about a crossing, each about what the last one found
OTHER_CROSSING = 0.5  # of the rise time: the nearest other crossing of a band is a rise time away
MARGIN = 4.0  # standard uncertainties by which the band is moved: the largest of a dozen means about an extremum
FLATTENED = 0.005  # of an extremum, by which the moving mean lowers it at most: (ω·0.12·rise)²/24 = 0.002 for ζ = 0.6
RISE_POINTS = 6.0  # samples within the rise time that are needed to resolve a tenth of 1/f_n


@dataclass(frozen=True)
class StepFigures:
    """Overshoot as a share of the step; times in s from the edge of the drive. ``…_error`` are standard uncertainties.

    settling_low_s, settling_high_s : settling times for a band that is wider and narrower by four standard uncertainties; they
    lie far apart where an extremum of the response is near the edge of the band
    """

    overshoot: float
    overshoot_error: float
    settling_s: float
    settling_error_s: float
    settling_low_s: float
    settling_high_s: float
    rise_s: float
    rise_error_s: float
    delay_s: float

    @property
    def settling_identified(self) -> bool:
        """Whether the settling time is the same for an extremum on either side of the band's edge.

        On the flank of an extremum a crossing is uncertain by as much as the next crossing is away: its own uncertainty does not
        tell them apart, so that the time between the bands is compared with the rise time too.
        """
        apart = self.settling_high_s - self.settling_low_s
        return apart <= min(4.0 * MARGIN * self.settling_error_s, OTHER_CROSSING * self.rise_s)


def step_figures(
    time: Array, response: Array, error: Array, *, band: float, edge_error_s: float = 0.0, bin_s: float = 0.0
) -> StepFigures:
    """Figures of a response that is normalised: 0 before the edge of the drive at time 0, 1 at the end.

    Crossings and the maximum are those of parabolas through the points near them, which noise does not bias.

    Parameters
    ----------
    time : (n,), s, increasing
    response, error : (n,), share of the step, and its standard uncertainty
    band : share of the step
    edge_error_s : standard uncertainty of the edge's time
    bin_s : duration over which each value is a mean; the curvature within it is taken out

    Raises
    ------
    NotIdentified
        The response does not rise, does not settle within the record, or the time base is too coarse.
    """
    noise = float(np.sqrt(np.mean(error**2)))
    if 3.0 * noise > band:
        raise NotIdentified(
            f"step: noise {100.0 * noise:.3g} % of the step, a third of the band at most is needed; average more steps"
        )
    ten, ninety = (_first_above(time, response, level) for level in (0.1, 0.9))
    rise = ninety - ten
    within = int(np.count_nonzero((time >= ten) & (time <= ninety)))
    if within < FEWEST:
        raise NotIdentified(f"step: {within} points in the rise time, {FEWEST} are needed; sample faster")
    width = 0.12 * rise
    blur = bin_s**2 / 12.0
    first, half, last = (
        _crossing(time, response, error, level, near, width, blur)
        for level, near in ((0.1, ten), (0.5, _first_above(time, response, 0.5)), (0.9, ninety))
    )
    top, top_error = _maximum(time, response, error, last[0], rise, blur)
    smooth, left = _smoothed(time, response, error, width)
    margin = MARGIN * left + FLATTENED * band
    settled = [_last_outside(time, smooth, size) for size in (band, band + margin, max(band - margin, 0.1 * band))]
    at, spread = _settling(time, response, error, band, settled[0], width, blur)
    return StepFigures(
        max(0.0, top - 1.0),
        top_error,
        at,
        float(np.hypot(spread, edge_error_s)),
        settled[1],
        settled[2],
        last[0] - first[0],
        float(np.hypot(last[1], first[1])),
        half[0],
    )


def aligned(times: Sequence[Array], responses: Sequence[Array]) -> list[Array]:
    """Times of several records of one step, shifted so that the responses agree; the mean of the shifts is zero.

    The edge of a sampled drive is known to a sample interval only, which would blur the mean of the records. The shift of
    a record is that of least squares on the slope of the mean of all.

    Parameters
    ----------
    times : s, of each record, from the edge of its drive; evenly spaced
    responses : share of the step
    """
    step = float(np.median(np.diff(times[0])))
    shifted = [time.copy() for time in times]
    for _ in range(ALIGNMENTS):
        steps = [np.round(time / step).astype(int) for time in shifted]
        first = min(int(indices.min()) for indices in steps)
        joined = np.concatenate(steps) - first
        count = np.maximum(np.bincount(joined), 1)
        mean = np.bincount(joined, weights=np.concatenate(responses)) / count
        grid = np.bincount(joined, weights=np.concatenate(shifted)) / count
        there = np.bincount(joined) > 0
        grid, mean = grid[there], mean[there]
        slope = np.gradient(mean, grid)
        shift: list[float] = []
        for time, response in zip(shifted, responses, strict=True):
            at = np.interp(time, grid, slope)
            off = response - np.interp(time, grid, mean)
            shift.append(float(np.sum(at * off) / np.sum(at**2)))
        middle = float(np.mean(shift))
        shifted = [time + offset - middle for time, offset in zip(shifted, shift, strict=True)]
    return shifted


def _smoothed(time: Array, response: Array, error: Array, width: float) -> tuple[Array, float]:
    """Means over a moving window of a width in s, and the standard uncertainty of one."""
    step = float(np.median(np.diff(time)))
    size = max(1, 2 * int(0.5 * width / step) + 1)
    padded = np.pad(response, size // 2, mode="edge")
    mean = np.convolve(padded, np.full(size, 1.0 / size), mode="valid")
    return mean, float(np.sqrt(np.mean(error**2) / size))


def _first_above(time: Array, response: Array, level: float) -> float:
    above = np.flatnonzero(response >= level)
    if above.size == 0 or above[0] == 0:
        raise NotIdentified(
            f"step: the response does not rise through {100.0 * level:g} % of the step; check drive, cable and trigger"
        )
    return float(time[above[0]])


def _last_outside(time: Array, response: Array, band: float) -> float:
    outside = np.flatnonzero(np.abs(response - 1.0) > band)
    if outside.size == 0 or outside[-1] > len(time) - 2 - FEWEST:
        raise NotIdentified(
            f"step: the response does not settle within ± {100.0 * band:.3g} % of the step; record longer"
        )
    return float(0.5 * (time[outside[-1]] + time[outside[-1] + 1]))


def _local(
    time: Array, response: Array, error: Array, near: float, width: float, blur: float
) -> tuple[Array, Array, float]:
    """Parabola in (t − near)/width through the points near a time: coefficients, covariance, and the half width used.

    Points that are means over times of variance ``blur``, s², lie above the response by half its curvature times that.
    """
    while True:
        rows = np.abs(time - near) <= width
        if np.count_nonzero(rows) >= FEWEST:
            break
        width *= 1.3
    x = (time[rows] - near) / width
    design = np.column_stack([np.ones_like(x), x, x**2]) / error[rows, None]
    covariance: Array = np.asarray(np.linalg.inv(design.T @ design), dtype=np.float64)
    c = covariance @ (design.T @ (response[rows] / error[rows]))
    c[0] -= c[2] * blur / width**2
    return c, covariance, width


def _crossing(
    time: Array, response: Array, error: Array, level: float, near: float, width: float, blur: float
) -> tuple[float, float]:
    """Time at which the response crosses a level near a time, and its standard uncertainty.

    The parabola is laid about the crossing that the last one found: about the first point above the level, which lies behind the
    crossing, a cubic term of the response would move it, by 0.02 % of a rise time over 17 samples.
    """
    slope, square = 1.0, 0.0
    for _ in range(CENTRINGS):
        c, covariance, width = _local(time, response, error, near, width, blur)
        x = 0.0
        for _ in range(20):  # Newton on the parabola; the slope at a crossing is not zero
            slope = c[1] + 2.0 * c[2] * x
            x = float(
                np.clip(
                    x - (c[0] + c[1] * x + c[2] * x**2 - level) / (slope if abs(slope) > 1e-12 else 1e-12), -1.0, 1.0
                )
            )
        row = np.array([1.0, x, x**2])
        slope, square = max(abs(c[1] + 2.0 * c[2] * x), 1e-12), float(row @ covariance @ row)
        near += width * x
    return near, float(width * np.sqrt(square) / slope)


def _settling(
    time: Array, response: Array, error: Array, band: float, near: float, width: float, blur: float
) -> tuple[float, float]:
    """Time of the last crossing into the band, and its standard uncertainty."""
    side = float(np.sign(np.interp(near - width, time, response) - 1.0)) or 1.0
    return _crossing(time, response, error, 1.0 + side * band, near, width, blur)


def _maximum(time: Array, response: Array, error: Array, after: float, rise: float, blur: float) -> tuple[float, float]:
    """Largest value of the response after a time, and its standard uncertainty.

    A polynomial of fourth degree is laid about the vertex of a parabola: a parabola alone cuts the top of a skewed maximum, and
    one about the largest point is raised by its noise.
    """
    inside = time >= after
    if not inside.any():
        return 1.0, float(error.mean())
    near = float(time[inside][int(np.argmax(response[inside]))])
    c, _, width = _local(time, response, error, near, 0.4 * rise, blur)
    near += width * (float(np.clip(-0.5 * c[1] / c[2], -1.0, 1.0)) if c[2] < 0.0 else 0.0)
    rows = np.abs(time - near) <= width
    design = np.vander((time[rows] - near) / width, 5) / error[rows, None]
    covariance = np.linalg.inv(design.T @ design)
    c = covariance @ (design.T @ (response[rows] / error[rows]))
    fine = np.linspace(-0.8, 0.8, 161)
    curve = np.vander(fine, 5)
    k = int(np.argmax(curve @ c))
    bend = float(np.polyval(np.polyder(c, 2), fine[k]))
    value = float(curve[k] @ c) - 0.5 * bend * blur / width**2
    return value, float(np.sqrt(curve[k] @ covariance @ curve[k]))
