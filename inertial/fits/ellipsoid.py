"""Sphere fit: bias and response matrix from poses of unknown orientation, where only the norm of gravity is known."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from inertial.arrays import Array, Index
from inertial.errors import NotIdentified
from inertial.estimation.noise_shares import LONGEST
from inertial.fits.descent import descended
from inertial.fits.norm_noise import whitener_of_norms

Shape = Literal["nine", "six"]

_ROUNDS = 3  # of the noise, which depends on the directions of the force
_SETTLED = 1e-12  # share of the cost that a step no longer takes off
_SINGULAR = 1e-10  # eigenvalue of the scaled normal matrix below which a parameter is not determined
_UPPER = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@dataclass(frozen=True)
class EllipsoidFit:
    """Calibration of which the mounting's rotation is not known: f = C·(a - b - h·(T - T0)), C upper triangular."""

    bias: Array
    """(..., 3), output unit."""
    correction: Array
    """(..., 3, 3) upper triangular C = K⁻¹, g per output unit: x stays along the sensor's own x axis."""
    temperature_offset: Array
    """(..., 3), output unit per °C; zero where no temperature was given."""
    reference_temperature: Array
    """(...,) T0, mean of the temperatures given, °C; NaN where none was."""
    norm_residuals: Array
    """(..., n) |f| - g, in g."""

    @property
    def response(self) -> Array:
        """K = C⁻¹ (..., 3, 3), output unit per g, upper triangular."""
        return np.asarray(np.linalg.inv(self.correction), dtype=np.float64)

    @property
    def rms(self) -> Array:
        """Root mean square of the norm residuals (...,), g."""
        return np.sqrt(np.mean(self.norm_residuals**2, axis=-1))

    def apply(self, output: Array, temperature: Array | None = None) -> Array:
        """Specific force (..., n, 3) in g of an output (..., n, 3), output unit, at `temperature` (..., n), °C."""
        centred = output - self.bias[..., None, :]
        if temperature is not None:
            rise = temperature - self.reference_temperature[..., None]
            centred = centred - self.temperature_offset[..., None, :] * rise[..., None]
        return np.einsum("...ij,...nj->...ni", self.correction, centred)


def fit_ellipsoid(
    output: ArrayLike,
    *,
    norm: float = 1.0,
    temperature: ArrayLike | None = None,
    shape: Shape = "nine",
    time: ArrayLike | None = None,
    error: ArrayLike | None = None,
) -> EllipsoidFit:
    """Least-squares fit of |C·(a - b - h·(T - T0))| = norm to dwells of unknown orientation, units as a batch.

    Starts from the algebraic fit of an ellipsoid whose axes lie along the sensor's, then Gauss-Newton with step control
    on the residuals of the norm, which are what matters. A rotation in front of C changes no norm: C is upper triangular.

    Parameters
    ----------
    output : (..., n, 3), output unit
    norm : local gravity in g
    temperature : (..., n), °C; adds an offset per °C and axis
    shape : "nine" for bias, scale and non-orthogonality, "six" for bias and scale
    time : (n,), s, of the dwells: what wanders between them is then estimated, and the dwells are weighted by it. Without it,
        and beyond 1500 dwells, whose covariance would not fit, the residuals are taken for white and alike
    error : (..., n), white standard error of the norm of each dwell, g; alike and not known where None

    Raises
    ------
    NotIdentified
        Fewer dwells than unknowns, or orientations that leave a coefficient undetermined.
    """
    a = np.asarray(output, dtype=np.float64)
    lead, n = a.shape[:-2], a.shape[-2]
    heat = np.zeros((*lead, n)) if temperature is None else np.asarray(temperature, dtype=np.float64)
    reference = heat.mean(axis=-1)
    free = 6 if shape == "six" else 9
    free_heat = 0 if temperature is None else 3
    if n <= free + free_heat:
        raise NotIdentified(
            f"sphere fit: {n} dwell{'s' * (n != 1)}, more than {free + free_heat} are needed; add poses"
        )
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(heat))):
        where = np.argwhere(~np.isfinite(a) if not np.all(np.isfinite(a)) else ~np.isfinite(heat))[0].tolist()
        raise NotIdentified(
            f"sphere fit: dwell {where[len(lead)]} is not finite, every output and temperature must be; leave it out"
        )
    flat = a.reshape(-1, n, 3)
    rise = np.broadcast_to(heat - reference[..., None], (*lead, n)).reshape(-1, n)
    # of bias (3), C (6) and temperature offset (3)
    chosen = np.concatenate([np.arange(free), 9 + np.arange(free_heat)]).astype(np.int64)
    problem = _Sphere(flat, rise, norm, chosen)
    theta = problem.solve(problem.algebraic())
    if time is not None and n <= LONGEST:
        white = np.ones((len(flat), n)) if error is None else np.asarray(error, dtype=np.float64).reshape(len(flat), n)
        theta = _with_wander(problem, theta, np.asarray(time, dtype=np.float64), white)
    _scaled(problem.weighted(problem.rows(theta)))  # refused where the solution itself is not determined
    bias, c, h = _unpack(theta)
    return EllipsoidFit(
        bias=bias.reshape(*lead, 3),
        correction=c.reshape(*lead, 3, 3),
        temperature_offset=h.reshape(*lead, 3),
        reference_temperature=reference if temperature is not None else np.full(lead, np.nan),
        norm_residuals=problem.residuals(theta).reshape(*lead, n),
    )


def _with_wander(problem: "_Sphere", theta: Array, time: Array, error: Array) -> Array:
    """Parameters (u, 12) weighted by the noise of the norms of each unit."""
    for _ in range(_ROUNDS):
        _, force, size = problem.force(theta)
        each = zip(problem.residuals(theta), problem.rows(theta), force / size[..., None], error, strict=True)
        problem.whiten = np.stack([whitener_of_norms(left, rows, way, time, white) for left, rows, way, white in each])
        theta = problem.solve(theta)
    return theta


def _unpack(theta: Array) -> tuple[Array, Array, Array]:
    """Bias (u, 3), C (u, 3, 3), temperature offset (u, 3) of parameters (u, 12)."""
    c = np.zeros((theta.shape[0], 3, 3))
    for k, (i, j) in enumerate(_UPPER):
        c[:, i, j] = theta[:, 3 + k]
    return theta[:, :3], c, theta[:, 9:]


class _Sphere:
    """Residuals |f| - norm of a batch (u, n, 3) and their derivatives."""

    def __init__(self, output: Array, rise: Array, norm: float, free: Index) -> None:
        self.output, self.rise, self.norm, self.free = output, rise, norm, free
        self.whiten: Array | None = None

    def algebraic(self) -> Array:
        """Start (u, 12) from the linear fit of p·a² + q·a = 1 per axis, in units that keep it well conditioned."""
        centre = 0.5 * (self.output.max(axis=1) + self.output.min(axis=1))
        span = 0.5 * (self.output.max(axis=1) - self.output.min(axis=1))
        if not np.all(span > 0.0):
            axis = "xyz"[int(np.argwhere(~(span > 0.0))[0][1])]
            raise NotIdentified(f"sphere fit: output {axis} never changes, all axes must be turned; check the channel")
        scaled = (self.output - centre[:, None, :]) / span[:, None, :]
        columns = np.concatenate([scaled**2, scaled], axis=-1)
        p = np.einsum("upn,un->up", np.linalg.pinv(columns), np.ones(self.output.shape[:2]))
        square, line = p[:, :3], p[:, 3:]
        theta = np.zeros((self.output.shape[0], 12))
        good = np.all(square > 0.0, axis=1)
        safe = np.where(good[:, None], square, 1.0)
        middle = np.where(good[:, None], -0.5 * line / safe, 0.0)
        level = 1.0 + np.sum(safe * middle**2, axis=1)
        theta[:, :3] = centre + middle * span
        theta[:, 3:6] = self.norm * np.sqrt(safe / np.where(good, level, 1.0)[:, None]) / span
        return theta

    def force(self, theta: Array) -> tuple[Array, Array, Array]:
        """Centred output, corrected force and its norm."""
        bias, c, h = _unpack(theta)
        centred = self.output - bias[:, None, :] - self.rise[..., None] * h[:, None, :]
        f = np.einsum("uij,unj->uni", c, centred)
        return centred, f, np.linalg.norm(f, axis=-1)

    def residuals(self, theta: Array) -> Array:
        """|f| - norm, (u, n)."""
        return self.force(theta)[2] - self.norm

    def rows(self, theta: Array) -> Array:
        """Derivatives (u, n, p) of the residuals by the free parameters."""
        centred, f, size = self.force(theta)
        direction = f / size[..., None]
        by_output = np.einsum("uni,uij->unj", direction, _unpack(theta)[1])
        by_c = np.stack([direction[..., i] * centred[..., j] for i, j in _UPPER], axis=-1)
        rows = np.concatenate([-by_output, by_c, -by_output * self.rise[..., None]], axis=-1)
        return rows[..., self.free]

    def solve(self, theta: Array) -> Array:
        """Parameters (u, 12) of least squared residuals: Gauss-Newton, each unit's step halved while it does not help."""

        def step(at: Array) -> Array:
            change = np.zeros_like(at)
            change[:, self.free] = _solve(self.weighted(self.rows(at)), -self._left(at))
            return change

        return descended(theta, step, lambda at: np.sum(self._left(at) ** 2, axis=-1), _SETTLED)

    def weighted(self, rows: Array) -> Array:
        """Rows (u, n, p), weighted where the noise of the norms is known."""
        return rows if self.whiten is None else self.whiten @ rows

    def _left(self, theta: Array) -> Array:
        """Residuals (u, n), weighted where the noise of the norms is known."""
        return self.weighted(self.residuals(theta)[..., None])[..., 0]


def _scaled(rows: Array) -> tuple[Array, Array]:
    """Columns of equal length, and their lengths; refuses columns that depend on each other."""
    size = np.linalg.norm(rows, axis=1)
    unit = rows / np.where(size > 0.0, size, 1.0)[:, None, :]
    smallest = np.linalg.eigvalsh(np.swapaxes(unit, -1, -2) @ unit)[:, 0]
    if not np.all(smallest >= _SINGULAR):
        raise NotIdentified(
            f"sphere fit: unit {int(np.argmin(smallest))} of the batch: the orientations leave a coefficient undetermined; "
            "add poses in between, with every axis up and down"
        )
    return unit, size


def _solve(rows: Array, target: Array) -> Array:
    unit, size = _scaled(rows)
    gram = np.swapaxes(unit, -1, -2) @ unit
    return np.asarray(
        np.linalg.solve(gram, np.einsum("unp,un->up", unit, target)[..., None])[..., 0] / size, dtype=np.float64
    )
