"""A sensor turned about one of its axes: bias, scale and misalignment of the two axes in the plane.

The forces lie in a plane, f = (fᵢ, fⱼ) along the two axes in it. Outputs of the axes in the plane give their bias and their
response to both; the axis across the plane gives its bias, which includes the tilt of the axis of rotation (1 mrad is 1 mg), and
two couplings, but no scale (IEEE Std 1293). Where the poses are not known, |f| = g is an ellipse in the two outputs; a rotation
in the plane is then no error, so that i stays along the sensor's own i axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.distributions import f_tail
from inertial.errors import NotIdentified
from inertial.fits.descent import descended
from inertial.fits.norm_noise import whitener_of_norms
from inertial.fits.wander import student

FLAT = 0.05
"""Singular value of the directions across a plane, over the largest, below which they lie in the plane: 3° of wobble."""

ALONG = 0.98
"""Cosine from which on the normal of a plane is an axis of the sensor."""

QUIET = 0.05
"""Range of an output, over the largest, below which it does not respond to gravity."""

ARC = 0.25
"""Range of the fitted force along each axis in a plane, over gravity, below which outputs show no ellipse: an arc of 83°.

Without it a bias and a scale that grow together make every force alike, and |f| = g of any outputs.
"""

FEWEST_DOF = 15
_LEAST, _TURNED = 4, 0.8
_ROUNDS, _SETTLED = 3, 1e-12
_NO_ELLIPSE = (
    "plane: the outputs of the two axes lie on no ellipse; turn further about the third axis, check the channels"
)


@dataclass(frozen=True)
class PlaneFit:
    """Calibration in a plane.

    across : axis of the sensor across the plane; inside : the two axes in it
    bias, bias_error : (3,), output unit; response, response_error : (3, 2), output unit per g along the two axes
    force : (n, 2), g, along the two axes; left : (n, s), residuals of the s series, g
    dof : of the least determined series; p_value : of noise alone against harmonics of the angle beside the model
    """

    across: int
    inside: tuple[int, int]
    bias: Array
    bias_error: Array
    response: Array
    response_error: Array
    force: Array
    left: Array
    dof: int
    p_value: float

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, g."""
        return float(np.sqrt(np.mean(self.left**2)))

    @property
    def misfit(self) -> float:
        """Residual of the worst series per degree of freedom, g: few dwells do not make it small."""
        return float(np.sqrt(np.max(np.sum(self.left**2, axis=0)) / self.dof))


def plane_across(force: Array) -> int | None:
    """The axis of the sensor across the plane of forces (n, 3); None where they lie in no plane, or in one across no axis."""
    _, values, turn = np.linalg.svd(force / np.linalg.norm(force, axis=1, keepdims=True), full_matrices=False)
    if values[2] > FLAT * values[0] or values[1] < FLAT * values[0]:
        return None
    axis = int(np.argmax(np.abs(turn[2])))
    return axis if abs(turn[2, axis]) > ALONG else None


def quiet_axis(output: Array) -> int | None:
    """The axis whose output (n, 3) stays the same where another turns through gravity; None where none does.

    It is dead, or the sensor was turned about it alone: the norm of gravity tells nothing of its scale.
    """
    if len(output) < _LEAST:
        return None
    spans = np.ptp(output, axis=0)
    weak, strong = int(np.argmin(spans)), int(np.argmax(spans))
    if not spans[strong] > 0.0 or spans[weak] > QUIET * spans[strong]:
        return None
    about_mean = np.median(np.linalg.norm(output - output.mean(axis=0), axis=1))
    return None if spans[strong] < _TURNED * float(about_mean) else weak


def inside_of(across: int) -> tuple[int, int]:
    """The two axes in the plane across an axis, in order."""
    first, second = sorted({0, 1, 2} - {across})
    return first, second


def fit_plane(output: Array, force: Array, across: int, time: Array, error: Array) -> PlaneFit:
    """Calibration from known poses in a plane.

    Parameters
    ----------
    output : (n, 3), output unit; force : (n, 3), g; time : (n,), s; error : (n, 3), white standard errors, output unit

    Raises
    ------
    NotIdentified
        Too few dwells.
    """
    i, j = inside_of(across)
    seen = force[:, [i, j]]
    columns = np.column_stack([np.ones(len(seen)), seen])
    _refuse_few(len(seen), 3)
    scale = _typical(output, seen, (i, j))
    solved = [_solved(columns, output[:, axis], np.ones((len(seen), 1)), time, error[:, axis]) for axis in range(3)]
    angle = np.arctan2(seen[:, 0], seen[:, 1])
    values = np.array([line.value for line in solved])
    errors = np.array([line.error for line in solved])
    each = np.array([_harmonics(line, angle, (2, 3)) for line in solved])
    p = float(np.minimum(1.0, 3.0 * each.min()))  # a nan stays one, which min() of Python turns into 1
    left = np.stack([line.left for line in solved], axis=1) / scale
    return PlaneFit(
        across, (i, j), values[:, 0], errors[:, 0], values[:, 1:], errors[:, 1:], seen, left, len(seen) - 3, p
    )


def fit_plane_norm(output: Array, across: int, norm: float, time: Array, error: Array) -> PlaneFit:
    """Calibration from unknown poses in a plane: an ellipse in the outputs of the two axes in it.

    Parameters
    ----------
    norm : gravity, g; the others as in :func:`fit_plane`

    Raises
    ------
    NotIdentified
        Too few dwells, or outputs that lie on no ellipse.
    """
    i, j = inside_of(across)
    flat = output[:, [i, j]]
    _refuse_few(len(flat), 5)
    theta = _ellipse(flat, norm)
    white = np.linalg.norm(error[:, [i, j]] / _matrix(theta).diagonal(), axis=1) / np.sqrt(2.0)
    whiten = np.diag(1.0 / white)
    for _ in range(_ROUNDS):
        theta = _descended(flat, theta, norm, whiten)
        force, rows, left = _state(flat, theta, norm)
        way = force / np.linalg.norm(force, axis=1, keepdims=True)
        whiten = whitener_of_norms(left, rows, way, time, white)
    theta = _descended(flat, theta, norm, whiten)
    force, rows, left = _state(flat, theta, norm)
    along = np.ptp(force, axis=0) / norm
    if not (np.all(_matrix(theta).diagonal() > 0.0) and np.all(along > ARC)):
        raise NotIdentified(_NO_ELLIPSE)  # the norm is right because all forces are alike, not because of an ellipse
    ellipse = _Series.of(rows, left, whiten)
    columns = np.column_stack([np.ones(len(flat)), force])
    other = _solved(columns, output[:, across], np.ones((len(flat), 1)), time, error[:, across])
    bias, bias_error = np.zeros(3), np.zeros(3)
    response, response_error = np.zeros((3, 2)), np.zeros((3, 2))
    bias[[i, j]], bias_error[[i, j]] = theta[:2], ellipse.error[:2]
    response[[i, j]], response_error[[i, j]] = _matrix(theta), _matrix(np.concatenate([theta[:2], ellipse.error[2:]]))
    bias[across], bias_error[across] = other.value[0], other.error[0]
    response[across], response_error[across] = other.value[1:], other.error[1:]
    p = _harmonics(ellipse, np.arctan2(force[:, 0], force[:, 1]), (3, 4))
    scale = float(np.mean(np.abs(_matrix(theta).diagonal())))
    both = np.column_stack([left / norm, other.left / scale])
    return PlaneFit(across, (i, j), bias, bias_error, response, response_error, force, both, len(flat) - 5, p)


@dataclass(frozen=True)
class _Series:
    """Least squares of one series: coefficients (k,), their errors, residuals (n,), whitener, whitened columns and residuals."""

    value: Array
    error: Array
    left: Array
    whiten: Array
    white: Array
    rest: Array

    @classmethod
    def of(cls, columns: Array, series: Array, whiten: Array) -> "_Series":
        white, target = whiten @ columns, whiten @ series
        size = np.linalg.norm(white, axis=0)
        size = np.where(size > 0.0, size, 1.0)
        value = np.linalg.lstsq(white / size, target, rcond=None)[0] / size
        rest = target - white @ value
        dof = len(target) - columns.shape[1]
        inverse = np.linalg.pinv((white / size).T @ (white / size)) / np.outer(size, size)
        error = student(dof) * np.sqrt(float(rest @ rest) / dof * np.maximum(np.diagonal(inverse), 0.0))
        return cls(value, error, series - columns @ value, whiten, white, rest)


def _solved(columns: Array, series: Array, direction: Array, time: Array, error: Array) -> _Series:
    """A linear fit of a series with the wander that its residuals show."""
    first = np.linalg.lstsq(columns / error[:, None], series / error, rcond=None)[0]
    return _Series.of(columns, series, whitener_of_norms(series - columns @ first, columns, direction, time, error))


def _harmonics(series: _Series, angle: Array, orders: Sequence[int]) -> float:
    """Probability, under noise alone, of the reduction by sines and cosines of the angle; nan below two degrees of freedom."""
    waves = np.column_stack([wave(order * angle) for order in orders for wave in (np.cos, np.sin)])
    dof = len(angle) - series.white.shape[1] - waves.shape[1]
    if dof < 2:
        return float("nan")
    basis, _ = np.linalg.qr(series.white)
    waves = series.whiten @ waves
    free = waves - basis @ (basis.T @ waves)
    turned, _ = np.linalg.qr(free)
    drop = float(np.sum((turned.T @ series.rest) ** 2))
    rest = max(float(series.rest @ series.rest) - drop, 1e-300)
    return float(f_tail(drop / waves.shape[1] / (rest / dof), waves.shape[1], dof))


def _refuse_few(dwells: int, coefficients: int) -> None:
    if dwells <= coefficients:
        raise NotIdentified(
            f"plane: {number_of(dwells, 'dwell')}, more than {coefficients} are needed for the axes in the plane; add poses"
        )


def _typical(output: Array, seen: Array, inside: tuple[int, int]) -> float:
    """Output per g of the axes in the plane."""
    columns = np.column_stack([np.ones(len(seen)), seen])
    response = np.linalg.lstsq(columns, output[:, list(inside)], rcond=None)[0][1:]
    return float(np.sqrt(np.sum(response**2) / 2.0))


def _matrix(theta: Array) -> Array:
    """K (2, 2), upper triangular, of (bᵢ, bⱼ, Kᵢᵢ, Kᵢⱼ, Kⱼⱼ)."""
    return np.array([[theta[2], theta[3]], [0.0, theta[4]]])


def _state(flat: Array, theta: Array, norm: float) -> tuple[Array, Array, Array]:
    """Force (n, 2), derivatives (n, 5) of |f| − g, and |f| − g."""
    inverse = np.linalg.inv(_matrix(theta))
    force = (flat - theta[:2]) @ inverse.T
    size = np.linalg.norm(force, axis=1)
    along = (force / size[:, None]) @ inverse
    rows = -np.column_stack([along, along[:, 0] * force[:, 0], along[:, 0] * force[:, 1], along[:, 1] * force[:, 1]])
    return force, rows, size - norm


def _ellipse(flat: Array, norm: float) -> Array:
    """Start from the algebraic fit of an ellipse."""
    centre, span = 0.5 * (flat.max(axis=0) + flat.min(axis=0)), 0.5 * np.ptp(flat, axis=0)
    x, y = ((flat - centre) / span).T
    p = np.linalg.lstsq(np.column_stack([x**2, x * y, y**2, x, y]), np.ones(len(flat)), rcond=None)[0]
    shape = np.array([[p[0], 0.5 * p[1]], [0.5 * p[1], p[2]]])
    if not np.all(np.linalg.eigvalsh(shape) > 0.0):
        raise NotIdentified(_NO_ELLIPSE)
    middle = -0.5 * np.linalg.solve(shape, p[3:])
    level = 1.0 + middle @ shape @ middle
    correction = np.linalg.cholesky(shape / level).T * norm / span
    k = np.linalg.inv(correction)
    return np.array([*(centre + middle * span), k[0, 0], k[0, 1], k[1, 1]])


def _descended(flat: Array, theta: Array, norm: float, whiten: Array) -> Array:
    """Parameters of the least whitened residual."""

    def step(at: Array) -> Array:
        _, rows, left = _state(flat, at[0], norm)
        white = whiten @ rows
        size = np.linalg.norm(white, axis=0)
        return -(np.linalg.lstsq(white / size, whiten @ left, rcond=None)[0] / size)[None]

    def cost(at: Array) -> Array:
        return np.array([np.sum((whiten @ _state(flat, at[0], norm)[2]) ** 2)])

    return descended(theta[None], step, cost, _SETTLED)[0]
