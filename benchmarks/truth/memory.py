"""Operators with memory: lags, play, Preisach relays, relaxation after moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]


def lag(series: Floats, tau: float, step: float) -> Floats:
    """First-order lag of `series`, (..., G), with time constant `tau`, s, on a grid of `step`, s; starts in equilibrium."""
    keep = float(np.exp(-step / tau))
    start = series[..., :1] * keep
    return lfilter([1.0 - keep], [1.0, -keep], series, axis=-1, zi=start)[0]


def play(series: Floats, width: Floats | float) -> Floats:
    """Play (backlash) operator of half-width `width` along the last axis of `series`, starting in the middle of its gap."""
    out = np.empty_like(series)
    state = series[..., 0].copy()
    for step in range(series.shape[-1]):
        value = series[..., step]
        state = np.minimum(np.maximum(state, value - width), value + width)
        out[..., step] = state
    return out


def preisach(series: Floats, low: float, high: float, cells: int = 24) -> Floats:
    """Preisach ensemble of evenly weighted relays between `low` and `high`, driven along the last axis; in -1…1."""
    levels = np.linspace(low, high, cells)
    up, down = (grid[np.triu_indices(cells, 1)] for grid in np.meshgrid(levels, levels, indexing="xy"))
    state = np.where(series[..., :1] > (up + down) / 2.0, 1.0, -1.0)
    out = np.empty_like(series)
    for step in range(series.shape[-1]):
        value = series[..., step, None]
        state = np.where(value >= up, 1.0, np.where(value <= down, -1.0, state))
        out[..., step] = state.mean(axis=-1)
    return out


def relaxation(force: Floats, start_force: Floats, wait: Floats, dwell: Floats, stay: Floats, tau: Floats) -> Floats:
    """What a viscoelastic element still has to give, averaged over each dwell, (U, n, 3), in g.

    force : (U, n, 3), g, per pose; start_force : (U, 3), g, before the first move; wait, dwell, stay : (n,), s, from the move's
    end to the dwell's start, the dwell, and until the next move; tau : (U,), s. Exact for a force constant in each pose.
    """
    tau = tau[:, None]
    left = np.zeros_like(start_force)
    before = start_force
    out = np.empty_like(force)
    for k in range(force.shape[1]):
        left = left + force[:, k] - before
        mean = (np.exp(-wait[k] / tau) - np.exp(-(wait[k] + dwell[k]) / tau)) * tau / dwell[k]
        out[:, k] = left * mean
        left = left * np.exp(-stay[k] / tau)
        before = force[:, k]
    return out
