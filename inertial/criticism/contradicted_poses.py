"""Recorded poses that contradict the outputs of most units in most dwells, and the reading of them that does not."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from inertial.arrays import Array, Flags
from inertial.criticism.evidence import GROSS
from inertial.data_errors.readings import FOLLOWS_G, design
from inertial.errors import NotIdentified
from inertial.estimation.lot import Lot
from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.frames import force_from_angles

_SPHERE = 12
"""Coefficients of the sphere on which outputs lie: biases, their temperature slopes, response without the mounting's rotation."""


def contradiction(lot: Lot) -> tuple[str, Lot]:
    """What is wrong with the poses of a lot, and the lot with a nominal scale that does not rest on these poses.

    The text is empty if the poses agree with the outputs, or if nothing explains the outputs of most units better: those of a
    defective sensor, which no pose explains, are left to the search for effects.
    """
    there = np.asarray(np.isfinite(lot.error).all(axis=(0, 2)))
    if lot.radial or np.count_nonzero(there) <= _SPHERE:
        return "", lot
    scale = np.ones((len(lot.output), 1)) if lot.scale is None else lot.scale
    force, output = np.broadcast_to(lot.state.force, (*lot.state.time.shape, 3)), lot.output * scale[:, None]
    spread = _spread(output[:, there])[:, None]
    output = output / spread[..., None]
    left = _misfit(lot, output, force, there)
    for text, other, seen in _other_readings(lot, output, force, there) if left > FOLLOWS_G else ():
        size = float(np.median(_spread(other[:, there])))
        if size * left > GROSS > _misfit(lot, output, other, seen):
            found = f"the recorded poses do not agree with the outputs in most dwells (residual {size * left:.2g} g): {text}"
            per_g = np.repeat(spread / size, lot.output.shape[-1], axis=1)
            return found, replace(lot, output=output * size, error=lot.error * (scale / per_g)[:, None], scale=per_g)
    return "", lot


def _other_readings(lot: Lot, output: Array, force: Array, there: Flags) -> Iterator[tuple[str, Array, Flags]]:
    """What the poses look like, the forces (units, n, 3), g, if they are that, and the dwells (n,) to judge it by."""
    outer, inner = lot.state.outer, lot.state.inner
    if outer is not None and inner is not None:
        small = max(np.abs(outer).max(), np.abs(inner).max()) < np.radians(2.0 * np.pi + 0.01)
        for text, angles in (
            ("the angles look like radians; give them in degrees", (np.degrees(outer), np.degrees(inner))),
            ("outer and inner angles look exchanged; exchange them", (inner, outer)),
            ("the origin of the outer angle looks 90° off; correct it", (0.5 * np.pi - outer, inner)),
        )[0 if small else 1 :]:
            yield text, np.broadcast_to(force_from_angles(*angles), force.shape), there
    for rows, text in ((1, "early"), (-1, "late")):
        seen = there & (np.roll(np.arange(there.size), rows) - np.arange(there.size) == -rows)
        yield f"they look one row too {text}; move them", np.roll(force, rows, axis=1), seen
    if len(lot.state.axes) < 3:
        return
    warm, n = lot.state.temperature, np.count_nonzero(there)
    try:
        fit = fit_ellipsoid(output[:, there], temperature=None if warm is None else warm[:, there])
    except NotIdentified:
        return
    # in the axes of the sensors: these forces explain the outputs by their construction, so that their norm is the test
    if np.median(fit.rms) * np.sqrt(n / (n - _SPHERE)) < GROSS:
        text = "the outputs alone are those of sound sensors; check origin, sign and unit of the angles, and the order of rows"
        yield text, fit.apply(output, warm), there


def _spread(values: Array) -> Array:
    """RMS distance of vectors (units, n, m) from their mean, (units,)."""
    return np.sqrt(np.mean(np.sum((values - values.mean(axis=1, keepdims=True)) ** 2, axis=-1), axis=-1))


def _misfit(lot: Lot, output: Array, force: Array, there: Flags) -> float:
    """Median over dwells and units of the residual of an output by bias, response and their slopes over temperature."""
    warm = lot.state.temperature
    theta = None if warm is None or np.ptp(warm) < 1.0 else (warm - warm.mean(axis=1, keepdims=True))[:, there]
    x, output = design(force[:, there], theta), output[:, there]
    return float(np.median(np.linalg.norm(output - x @ (np.linalg.pinv(x) @ output), axis=-1)))
