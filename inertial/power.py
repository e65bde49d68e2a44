"""Devices switched off and on again within a run: when, for how long, and how cold they have become."""

import numpy as np

from inertial.arrays import Array
from inertial.state import State


def switched(state: State) -> list[int]:
    """Numbers of the dwells right before which the devices were off for a time that is known."""
    if state.power_off is None or state.since_power is None:
        return []
    off = state.power_off.reshape(-1, state.power_off.shape[-1])
    return np.flatnonzero(np.any(off > 0.0, axis=0)).tolist()


def since_first(state: State) -> Array:
    """Seconds since the first dwell in time, (..., n), in whatever order the dwells are given; never negative."""
    return state.time - state.time.min(axis=-1, keepdims=True)


def coldness(state: State, tau: float) -> Array:
    """Part of its warmth that each device lacked when it was last switched on, (..., n): one for the first time.

    A device cools without power as it warms with it, with ``tau`` s: off for less, it begins where it has not cooled to.
    """
    since = since_first(state) if state.since_power is None else state.since_power
    lacking = np.ones(np.broadcast_shapes(state.time.shape, since.shape))
    cycles = switched(state)
    if not cycles or state.power_off is None:
        return lacking
    on_at = state.time - since
    cold = np.ones(lacking.shape[:-1])
    for k in cycles:
        off = state.power_off[..., k]
        warming = np.maximum(on_at[..., k] - off - on_at[..., max(k - 1, 0)], 0.0)
        warm = 1.0 - cold * np.exp(-warming / tau) if k > 0 else np.zeros_like(cold)
        cold = 1.0 - warm * np.exp(-off / tau)
        lacking[..., k:] = cold[..., None]
    return lacking


def running(state: State) -> Array:
    """Seconds since the first power-on that go on counting while the devices are off, (..., n)."""
    if state.since_power is None:
        return since_first(state)
    if not switched(state):
        return state.since_power
    since = since_first(state)
    return since + np.where(since == 0.0, state.since_power, np.inf).min(axis=-1, keepdims=True)
