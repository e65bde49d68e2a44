"""Hidden effects of devices as physics: what a unit of each adds to the output of the axes, dwell by dwell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SMALL = 1e-4  # how far a curve is bent while its shape is taken
MOVE_S, DWELL_S, CREEP_S = 6.0, 10.0, 25.0
CURIE_K = 1100.0


def _hard_spring(force: Array, _kelvin: Array, _time: Array) -> Array:
    """A proof mass on a spring that hardens, x + c·x³ = f."""
    x = force.copy()
    for _ in range(6):
        x -= (x + SMALL * x**3 - force) / (1.0 + 3.0 * SMALL * x**2)
    return (x - force) / SMALL


def _narrow_gap(force: Array, _kelvin: Array, _time: Array) -> Array:
    """A pick-off whose field grows exponentially towards one side."""
    return (np.expm1(SMALL * force) / SMALL - force) / SMALL


def _two_springs(force: Array, _kelvin: Array, _time: Array) -> Array:
    """Another scale for + than for −, the change at zero rounded over two milli-g."""
    return np.sqrt(force**2 + 2e-3**2)


def _leaning_pendulum(force: Array, _kelvin: Array, _time: Array) -> Array:
    """A pendulum that leans under the force along its axis feels the one across."""
    return np.sin(SMALL * force) / SMALL * np.roll(force, -1, axis=1)


def _twisting_hinge(force: Array, _kelvin: Array, _time: Array) -> Array:
    """A hinge that twists with the square of its load turns the sensitive axis: no effect of the catalogue is like it."""
    return np.sin(SMALL * force**2) / SMALL * np.roll(force, -1, axis=1)


def _band_gap(_force: Array, kelvin: Array, _time: Array) -> Array:
    """The curvature of a band-gap reference, which moves the zero."""
    bend = kelvin / 300.0 * np.log(kelvin / 300.0) - (kelvin / 300.0 - 1.0)
    return np.tile(bend[:, None], (1, 3))


def _magnet(force: Array, kelvin: Array, _time: Array) -> Array:
    """The magnet of a torquer, whose strength falls ever faster towards its Curie temperature, by Bloch's law."""
    share = (kelvin / CURIE_K) ** 1.5 - (300.0 / CURIE_K) ** 1.5 * (1.0 + 1.5 * (kelvin / 300.0 - 1.0))
    return -force * share[:, None]


def _creeping_spring(force: Array, _kelvin: Array, time: Array) -> Array:
    """A spring with a slow part, which gives way after each move: the mean of a dwell that begins as the table stops."""
    held, out, last = force[0].copy(), np.empty_like(force), time[0]
    for k, here in enumerate(force):
        if k:
            rest = max(time[k] - last - DWELL_S - MOVE_S, 0.0)
            held = force[k - 1] + (held - force[k - 1]) * np.exp(-(DWELL_S + rest) / CREEP_S)
            between = 0.5 * (force[k - 1] + here)  # the move, at one rate
            held = between + (held - between) * np.exp(-MOVE_S / CREEP_S)
        out[k] = (held - here) * CREEP_S / DWELL_S * -np.expm1(-DWELL_S / CREEP_S)
        last = time[k]
    return out


PHYSICS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "third_order": _hard_spring, "second_order": _narrow_gap, "scale_asymmetry": _two_springs,
    "cross_coupling": _leaning_pendulum, "twisting_hinge": _twisting_hinge,
    "bias_temperature_quadratic": _band_gap,
    "scale_temperature_quadratic": _magnet, "creep_after_move": _creeping_spring,
}  # fmt: skip


def added(effect: str, force: Array, celsius: Array, time: Array) -> Array:
    """Output (n, 3) of a hidden effect, of which an ordinary calibration of each axis leaves an rms of one.

    Parameters
    ----------
    force : (n, 3), g, along the axes · celsius, time : (n,), °C and s
    """
    signal = PHYSICS[effect](force, celsius + 273.15, time)
    warm = celsius[:, None] - celsius.mean()
    for axis in range(3):
        ordinary = np.hstack([np.ones_like(warm), force, warm, warm * force[:, axis : axis + 1]])
        left = signal[:, axis] - ordinary @ np.linalg.lstsq(ordinary, signal[:, axis], rcond=None)[0]
        signal[:, axis] /= np.sqrt(np.mean(left**2))
    return signal
