"""Operators with memory: a lag, a play, a relaxation. Each runs along the last axis, which is time."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


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
    for k in range(drive.shape[-1]):
        out[..., k + 1] = keep[..., k] * out[..., k] + drive[..., k]
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
    # times first: a row is contiguous, and the loop is the cost of a search over half widths on a long history
    step = np.ascontiguousarray(np.diff(x.reshape(-1, x.shape[-1]), axis=-1).T / half_width)
    out = np.empty((x.shape[-1], step.shape[1]))
    out[0] = start
    for before, after, change in zip(out[:-1], out[1:], step, strict=True):
        np.add(before, change, out=after)
        np.maximum(after, -1.0, out=after)
        np.minimum(after, 1.0, out=after)
    return np.ascontiguousarray(out.T).reshape(x.shape)


def play_memory(signal: ArrayLike, half_width: float) -> Array:
    """How much of the unknown state before the first point a play still holds, (..., m): 1 at first, 0 once it was taken up."""
    return 0.5 * (play(signal, half_width, start=1.0) - play(signal, half_width, start=-1.0))


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
