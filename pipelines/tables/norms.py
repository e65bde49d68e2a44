"""Dwells of unknown orientation as a lot in g: corrected outputs and their directions by the norm of gravity.

The lot is linear about one point, the fit of an ellipsoid with the noise between dwells. Dwells that are far off take no part in
finding that point: it would carry their error into all the others.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inertial.arrays import NORMAL_MEDIAN
from inertial.data_errors.readings import Readings
from inertial.errors import NotIdentified
from inertial.estimation.problem import Lot
from inertial.fits.ellipsoid import EllipsoidFit, Shape, fit_ellipsoid
from inertial.fits.plane import quiet_axis
from inertial.state import State

Array = NDArray[np.float64]

WARM = 5.0
"""K over which a temperature must move for its own offset of the bias to be part of the point of expansion."""

_ONE_POSE = 0.15
"""Largest change of the outputs over their norm of a sensor that was not turned: bias over temperature, an uneven shelf."""

_FAR = 8.0
"""Robust standard deviations beyond which a dwell takes no part in finding the point of expansion."""

_SPARE, _ROUNDS = 6, 4  # degrees of freedom from which on single dwells are judged, and turns of leaving some out
_WHITE_RANGE = 20.0
"""Factor about the median beyond which a white standard error is taken for a slip: weights must not follow it."""


def lot_of_norms(readings: Readings, state: State, like: Readings, *, square: bool) -> Lot:
    """The radial lot of dwells whose poses are unknown: y = |C·(a − b)| − 1 in g, with white standard errors by axis.

    ``like`` and ``square`` are those of :func:`pipelines.tables.dwells.lot_of`.

    Raises
    ------
    NotIdentified
        Fewer dwells of a unit than unknowns, or orientations that leave one of them undetermined.
    """
    forces, outputs, errors = [], [], []
    for unit in range(len(readings.output)):
        fit = expansion(like, unit, shape="six" if square else "nine")
        there = readings.there[unit]
        corrected = np.zeros((there.size, 3))
        heat = _heat(readings, unit, there) if np.any(fit.temperature_offset) else None
        corrected[there] = fit.apply(readings.output[unit, there], heat)
        size = np.linalg.norm(corrected, axis=1, keepdims=True)
        direction = np.where(size > 0.0, corrected / np.where(size > 0.0, size, 1.0), (0.0, 0.0, 1.0))
        if heat is not None:
            # what the temperature does is put back along the linear model: the model that is judged may lack it
            rise = heat - float(fit.reference_temperature)
            corrected[there] += rise[:, None] * (fit.correction @ fit.temperature_offset)
        forces.append(direction)
        outputs.append(corrected)
        errors.append(np.where(there[:, None], _white(readings, unit, fit, size[:, 0]), np.inf))
    eye = np.broadcast_to(np.eye(3), (len(forces), 3, 3))
    recorded = readings.mean_error is not None
    known = replace(state, force=np.stack(forces), memory={})
    return Lot(known, np.stack(outputs), np.stack(errors), eye, radial=True, recorded=recorded)


def expansion(readings: Readings, unit: int, *, shape: Shape = "nine") -> EllipsoidFit:
    """The fit of an ellipsoid to a unit's dwells, weighted by their noise, without those that are far off.

    Raises
    ------
    NotIdentified
        As :func:`inertial.fits.ellipsoid.fit_ellipsoid`.
    """
    used = readings.there[unit].copy()
    _refuse_quiet(readings.output[unit, used])
    heat = _heat(readings, unit, used)
    warm = heat is not None and float(np.ptp(heat)) > WARM and shape == "nine"
    unknowns = {"six": 6, "nine": 9}[shape] + (3 if warm else 0)
    warm = warm and int(used.sum()) > unknowns + _SPARE
    try:
        fit = _fitted(readings, unit, used, shape, warm=warm)
    except NotIdentified:
        refuse_one_pose(readings.output[unit, used])
        raise
    for _ in range(_ROUNDS):
        if int(used.sum()) < unknowns + _SPARE:
            break
        far = _far(readings, unit, fit, used, warm=warm)
        if not far.any() or int((used & ~far).sum()) < unknowns + _SPARE:
            break
        try:
            fit = _fitted(readings, unit, used & ~far, shape, warm=warm)
        except NotIdentified:
            break
        used &= ~far
    return fit


def refuse_one_pose(output: Array) -> None:
    """Refuse dwells that all have one direction: further poses are no remedy for the record of a chamber or a shelf.

    For dwells that a fit could not use: counts of a converter with its zero far away change little beside their norm, too.
    """
    spans = np.ptp(output, axis=0)
    if len(output) > 1 and float(np.linalg.norm(spans)) < _ONE_POSE * float(np.median(np.linalg.norm(output, axis=1))):
        raise NotIdentified(
            "fit: the sensor was not turned: all dwells have one direction, in which the norm of gravity shows neither scale nor "
            "misalignment; turn it; or judge its bias and what drives it: import the record again with --set face=FACE (+x, -x … "
            "-z, the face that is up) --set local_gravity_m_s2=M/S2, and with --set block_s=60 where it is one long rest"
        )


def _refuse_quiet(output: Array) -> None:
    """Refuse dwells in which an axis does not answer to gravity: a fit of the norm would still give it a scale."""
    quiet = quiet_axis(output)
    if quiet is not None:
        name = "xyz"[quiet]
        raise NotIdentified(
            f"fit: output {name} stays the same while the others turn through gravity: {name} is dead, or the sensor was turned "
            f"about {name} alone, and the norm of gravity does not show its scale; turn all axes, or fit the two others with "
            "'tumbleline import FILE --fit plane'"
        )


def _far(readings: Readings, unit: int, fit: EllipsoidFit, used: NDArray[np.bool_], *, warm: bool) -> NDArray[np.bool_]:
    """Flags (n,) of the used dwell that is farthest from the ellipsoid, if it is far beyond the scatter of the others."""
    heat = _heat(readings, unit, readings.there[unit]) if warm else None
    left = np.zeros(used.size)
    there = readings.there[unit]
    left[there] = np.abs(np.linalg.norm(fit.apply(readings.output[unit, there], heat), axis=1) - 1.0)
    typical = float(np.median(left[used])) / NORMAL_MEDIAN
    worst = int(np.argmax(np.where(used, left, 0.0)))
    far = np.zeros(used.size, dtype=bool)
    far[worst] = left[worst] > _FAR * typical
    return far


def _fitted(readings: Readings, unit: int, used: NDArray[np.bool_], shape: Shape, *, warm: bool) -> EllipsoidFit:
    output = readings.output[unit, used]
    heat = _heat(readings, unit, used) if warm else None
    first = fit_ellipsoid(output, shape=shape, temperature=heat)
    size = np.linalg.norm(first.apply(output, heat), axis=1)
    axes = _white(readings, unit, first, np.ones(used.size))[used]
    direction = first.apply(output, heat) / np.where(size > 0.0, size, 1.0)[:, None]
    error = np.sqrt(np.sum((direction * axes) ** 2, axis=1))
    return fit_ellipsoid(output, shape=shape, temperature=heat, time=readings.time[unit, used], error=error)


def _heat(readings: Readings, unit: int, there: NDArray[np.bool_]) -> Array | None:
    """Temperatures of a unit's dwells; None where none are recorded, or one is missing."""
    temperature = readings.temperature if readings.temperature is not None else readings.chamber
    if temperature is None or not np.all(np.isfinite(temperature[unit, there])):
        return None
    return temperature[unit, there]


def _white(readings: Readings, unit: int, fit: EllipsoidFit, size: Array) -> Array:
    """White standard errors of a unit's dwells by axis, (n, 3), g: of the samples, else from the scatter of the norms."""
    scatter = max(float(fit.rms), 1e-12)
    if readings.mean_error is None:
        return np.full((size.size, 3), scatter)
    error = np.sqrt((readings.mean_error[unit] ** 2) @ (fit.correction**2).T)
    known = np.isfinite(error).all(axis=1) & (error > 0.0).all(axis=1)
    if not known.any():
        return np.full((size.size, 3), scatter)
    typical = np.median(error[known], axis=0)
    error = np.where(known[:, None], error, typical)
    return np.clip(error, typical / _WHITE_RANGE, typical * _WHITE_RANGE)
