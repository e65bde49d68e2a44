"""Operators with memory: a lag, a play, a relaxation. Each runs along the last axis, which is time."""

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array

_MANY = 64
"""Signals above which a play is faster point by point."""

_FEW = 8
"""Signals up to which a recursion is faster number by number than by arrays of one point of all signals."""


def first_order_lag(time: ArrayLike, signal: ArrayLike, tau: float) -> Array:
    """Output of ẏ = (x − y)/τ for a signal that is straight between its points, (..., m), the signal's unit.

    Exact for any spacing; at rest before the first point.

    Parameters
    ----------
    time : (m,) or (..., m), s, increasing
    signal : (..., m)
    tau : s
    """
    t, x = np.broadcast_arrays(np.asarray(time, dtype=float), np.asarray(signal, dtype=float))
    step = np.maximum(np.diff(t, axis=-1), 1e-9)
    slope = np.diff(x, axis=-1) / step
    keep = np.exp(-step / tau)
    drive = (x[..., 1:] - tau * slope) - keep * (x[..., :-1] - tau * slope)
    return recursion(x[..., 0], keep, drive)


def recursion(start: ArrayLike, keep: Array, drive: Array) -> Array:
    """y₀ = start, yₖ₊₁ = keepₖ·yₖ + driveₖ along the last axis, (..., m) for ``keep``, ``drive`` (..., m − 1)."""
    out = np.empty((*drive.shape[:-1], drive.shape[-1] + 1))
    out[..., 0] = start
    rows = out.reshape(-1, out.shape[-1])
    if len(rows) > _FEW:
        # times first: a row is contiguous
        keeps, driven = (
            np.ascontiguousarray(np.broadcast_to(a, drive.shape).reshape(len(rows), -1).T) for a in (keep, drive)
        )
        line = np.empty(rows.shape[::-1])
        line[0] = rows[:, 0]
        for before, after, k, d in zip(line[:-1], line[1:], keeps, driven, strict=True):
            np.multiply(before, k, out=after)
            np.add(after, d, out=after)
        rows[:] = line.T
        return out
    each = zip(*(np.broadcast_to(a, drive.shape).reshape(len(rows), -1).tolist() for a in (keep, drive)), strict=True)
    for row, (keeps, driven) in zip(rows, each, strict=True):
        line = [row[0].item()]
        for k, d in zip(keeps, driven, strict=True):
            line.append(k * line[-1] + d)
        row[:] = line
    return out


def play(signal: ArrayLike, half_width: float, start: float = 0.0) -> Array:
    """Where a signal stands inside its play, (..., m), from −1 (falling edge) to +1 (rising edge).

    The play (backlash) operator follows its input at a distance of ``half_width``; what is returned is
    (signal − operator)/half_width, the hysteretic part alone. Source: Visintin, Differential Models of Hysteresis, ch. III.

    Parameters
    ----------
    signal : (..., m)
    half_width : in the signal's unit, > 0
    start : position before the first point, −1 … 1
    """
    x = np.asarray(signal, dtype=float)
    if x.size > _MANY * x.shape[-1]:
        return _step_by_step(x, half_width, start)
    return _Clamps(x, half_width).from_start(start)


def play_memory(signal: ArrayLike, half_width: float) -> Array:
    """How much of the unknown state before the first point a play still holds, (..., m): 1 at first, 0 once it was taken up."""
    x = np.asarray(signal, dtype=float)
    if x.size > _MANY * x.shape[-1]:
        return 0.5 * (_step_by_step(x, half_width, 1.0) - _step_by_step(x, half_width, -1.0))
    clamps = _Clamps(x, half_width)
    return 0.5 * (clamps.from_start(1.0) - clamps.from_start(-1.0))


def _step_by_step(x: Array, half_width: float, start: float) -> Array:
    """A play (..., m) one point after the other, all signals at a time."""
    # times first: a row is contiguous
    step = np.ascontiguousarray(np.diff(x.reshape(-1, x.shape[-1]), axis=-1).T / half_width)
    out = np.empty((x.shape[-1], step.shape[1]))
    out[0] = start
    for before, after, change in zip(out[:-1], out[1:], step, strict=True):
        np.add(before, change, out=after)
        np.maximum(after, -1.0, out=after)
        np.minimum(after, 1.0, out=after)
    return np.ascontiguousarray(out.T).reshape(x.shape)


class _Clamps:
    """A play as a map from the position before a stretch of its signal to the position at each of its points.

    One step takes y to y + s, limited to −1 … 1, and several steps in turn are again of the form y → min(max(y + a, l), h).
    The signal is cut into about √m stretches of √m points: the maps of all stretches are found together, then the position at
    the start of each, so that a long history takes 2·√m operations on arrays instead of m.
    """

    def __init__(self, x: Array, half_width: float) -> None:
        self._shape = x.shape
        # times first: a row is contiguous
        step = np.diff(x.reshape(-1, x.shape[-1]), axis=-1).T / half_width
        self._count, self._rows = step.shape
        size = max(int(np.sqrt(self._count)), 1)
        stretches = -(-self._count // size)
        padded = np.zeros((stretches * size, self._rows))
        padded[: self._count] = step
        # (size, stretches, rows)
        steps = np.ascontiguousarray(np.swapaxes(padded.reshape(stretches, size, self._rows), 0, 1))
        self._shift = np.cumsum(steps, axis=0)
        self._ends = np.empty((size, 2, stretches, self._rows))
        ends = np.empty((2, stretches, self._rows))
        ends[0], ends[1] = -1.0, 1.0
        for change, clamped in zip(steps, self._ends, strict=True):
            np.add(ends, change, out=clamped)
            np.maximum(clamped, -1.0, out=clamped)
            np.minimum(clamped, 1.0, out=clamped)
            ends = clamped

    def from_start(self, start: float) -> Array:
        """Positions (..., m) from a position before the first point."""
        size, stretches, rows = self._shift.shape
        before = np.empty((stretches, rows))
        here = np.full(rows, start)
        for k in range(stretches):
            before[k] = here
            here = np.minimum(np.maximum(here + self._shift[-1, k], self._ends[-1, 0, k]), self._ends[-1, 1, k])
        inside = np.minimum(np.maximum(before + self._shift, self._ends[:, 0]), self._ends[:, 1])
        out = np.empty((rows, self._count + 1))
        out[:, 0] = start
        out[:, 1:] = np.swapaxes(inside, 0, 1).reshape(stretches * size, rows)[: self._count].T
        return out.reshape(self._shape)


def relaxation(time: ArrayLike, age: ArrayLike, kick: ArrayLike, tau: float) -> Array:
    """What is left, at each time, of all kicks so far: Σ kickₖ·exp(−(t − tₖ)/τ), (..., m).

    Parameters
    ----------
    time : (..., m), s
    age : (..., m), s since the latest kick
    kick : (..., m), size of the kick before each time
    tau : s
    """
    t, s, d = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (time, age, kick)))
    fresh = d * np.exp(-s / tau)
    keep = np.exp(-np.maximum(np.diff(t, axis=-1), 0.0) / tau)
    return recursion(fresh[..., 0], keep, fresh[..., 1:])


def approach(time: Array, tau: float) -> Array:
    """τ·(1 − exp(−t/τ)) at times (...), in the unit of both: what begins at a rate of one and comes to rest after a few τ."""
    return -tau * np.expm1(-time / tau)
