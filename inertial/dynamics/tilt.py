"""Single-axis tilt in one plane: bias, scale, angle and, from enough poses, K2 and K3 of the axes that lie in the plane."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.stats import norm

from inertial.arrays import Array
from inertial.dynamics.wander import wander
from inertial.errors import NotIdentified
from inertial.noise.flicker import flicker_kernel

TERMS = ("bias", "sine", "cosine", "second_order", "third_order")


FARTHEST = 8.0  # standard uncertainties beyond which noise adds nothing to a magnitude
GRID = 801


@dataclass(frozen=True)
class TiltFit:
    """Fit of one axis: output = bias + scale·sin(θ + φ), with K2 and K3 of the indicated force where asked for.

    value, covariance : (terms,), (terms, terms), terms as in ``names``; output unit
    residuals : (n,), output unit
    weights : (terms, n), of the outputs in the terms
    spread : (n,), standard deviation of each residual: noise, angle and the wander that the terms do not take up; output unit
    """

    names: tuple[str, ...]
    value: Array
    covariance: Array
    residuals: Array
    angle: Array
    weights: Array
    spread: Array

    @property
    def scale(self) -> tuple[float, float]:
        """Scale K1 and its standard uncertainty, output per g."""
        s, c = self.value[1:3]
        size = float(np.hypot(s, c))
        slope = np.array([s, c]) / size
        return size, float(np.sqrt(slope @ self.covariance[1:3, 1:3] @ slope))

    @property
    def phase(self) -> tuple[float, float]:
        """Angle φ of the input axis against the table's zero and its standard uncertainty, rad."""
        s, c = self.value[1:3]
        size = float(np.hypot(s, c))
        slope = np.array([-c, s]) / size**2
        return float(np.arctan2(c, s)), float(np.sqrt(slope @ self.covariance[1:3, 1:3] @ slope))

    def curve(self, angle: Array) -> Array:
        """Departure (n,) of the K2–K3 curve from bias and scale at table angles (n,), rad; output unit."""
        turn = angle + self.phase[0]  # from the zero of the input axis
        columns = np.column_stack([-0.5 * np.cos(2.0 * turn), -0.25 * np.sin(3.0 * turn)])
        return columns @ self.value[[self.names.index(name) for name in TERMS[3:]]]

    @property
    def departure(self) -> tuple[float, float]:
        """Largest departure of the K2–K3 curve from bias and scale over the turn, and its standard uncertainty; output unit.

        K2·sin² departs by −½·K2·cos 2θ and K3·sin³ by −¼·K3·sin 3θ from a constant and a sine. At θ = 90° and 270° both are
        largest, once with equal and once with opposite signs: ½·|K2| + ¼·|K3|, magnitudes without the share of their noise.
        """
        terms = [self.names.index(name) for name in TERMS[3:]]
        value, covariance = self.value[terms], self.covariance[np.ix_(terms, terms)]
        error = np.sqrt(np.diag(covariance))
        share = np.array([0.5, 0.25])
        sizes = np.array([magnitude(float(v), float(e)) for v, e in zip(value, error, strict=True)])
        slope = share * np.where(value < 0.0, -1.0, 1.0)
        return float(share @ sizes), float(np.sqrt(slope @ covariance @ slope))

    def phase_covariance(self, other: "TiltFit", angle_error: float) -> float:
        """Covariance of the phases of two axes from the errors of the angles, which both axes have in common; rad².

        Parameters
        ----------
        other : fit of the other axis at the same angles
        angle_error : standard uncertainty of each angle, rad
        """
        shares = [fit.phase_slope() * fit.scale[0] * np.cos(fit.angle + fit.phase[0]) for fit in (self, other)]
        return float(angle_error**2 * (shares[0] @ shares[1]))

    def phase_slope(self) -> Array:
        """Derivative (n,) of the phase by the outputs, rad over the output unit."""
        s, c = self.value[1:3]
        return np.asarray((s * self.weights[2] - c * self.weights[1]) / (s**2 + c**2))

    def of(self, name: str) -> tuple[float, float]:
        """Value and standard uncertainty of a term."""
        k = self.names.index(name)
        return float(self.value[k]), float(np.sqrt(self.covariance[k, k]))


def fit_tilt(angle: Array, output: Array, error: Array, *, orders: int = 1, time: Array | None = None) -> TiltFit:
    """Generalised least squares of one axis over angles in its plane.

    Parameters
    ----------
    angle : (n,), rad; the force along the axis is sin(angle + φ) g
    output, error : (n,), output unit; the error must hold noise and the share of the angle's uncertainty (scale·cos θ·u_θ)
    orders : 1 for bias and scale, 3 with K2 and K3; φ must be small then (below 0.1 rad), since the powers are of sin θ
    time : (n,), s, of the dwells; with it 1/f wander between them is estimated from the residuals, and weighs. Wander over a
        whole turn looks like a sine, more than its scatter from dwell to dwell shows.

    Raises
    ------
    NotIdentified
        The angles do not tell the terms apart.
    """
    names = TERMS[:3] if orders == 1 else TERMS
    rows = np.column_stack([np.ones_like(angle), np.sin(angle), np.cos(angle)])
    if orders > 1:
        plain = np.linalg.lstsq(rows / error[:, None], output / error, rcond=None)[0]
        size = float(np.hypot(plain[1], plain[2]))
        force = (rows[:, 1] * plain[1] + rows[:, 2] * plain[2]) / size
        rows = np.column_stack([rows, force**2, force**3])
    weighted = rows / error[:, None]
    if len(angle) < len(names) + 1 or np.linalg.matrix_rank(weighted, tol=1e-8 * np.linalg.norm(weighted, 2)) < len(
        names
    ):
        raise NotIdentified(
            f"tilt: {len(angle)} angles do not tell {', '.join(names)} apart; add angles over the whole turn"
        )
    noise_covariance = np.diag(error**2)
    if time is not None:
        kernel = flicker_kernel(time)
        noise_covariance = noise_covariance + wander(rows, output, noise_covariance, kernel).variance * kernel
    root = np.linalg.cholesky(noise_covariance)
    white_rows, white_output = np.linalg.solve(root, rows), np.linalg.solve(root, output)
    c = np.linalg.lstsq(white_rows, white_output, rcond=None)[0]
    covariance = np.asarray(np.linalg.inv(white_rows.T @ white_rows), dtype=np.float64)
    weights = np.asarray(np.linalg.solve(root.T, white_rows @ covariance).T, dtype=np.float64)
    left = np.eye(len(angle)) - rows @ weights
    spread = np.sqrt(np.einsum("ij,jk,ik->i", left, noise_covariance, left))
    return TiltFit(names, np.asarray(c, dtype=np.float64), covariance, output - rows @ c, angle, weights, spread)


def left_open(*, in_plane: bool) -> tuple[str, ...]:
    """What one plane leaves open for an axis that lies in it, or that is the axis of rotation."""
    if in_plane:
        return (
            "misalignment out of the plane",
            "cross-axis terms with the axis of rotation",
            "Kpp apart from K2 and bias",
        )
    return ("scale", "K2", "K3", "bias apart from scale times the tilt of the axis of rotation")


def magnitude(value: float, error: float) -> float:
    """The size μ for which the mean of |N(μ, σ²)| is the one found; 0 where noise alone makes as much on average.

    A largest departure, a sum of magnitudes, is otherwise that of the noise where nothing is there: 0.8 σ on average.

    Parameters
    ----------
    value : as estimated, of either sign; error : its standard uncertainty; both of one unit
    """
    if error <= 0.0 or abs(value) >= FARTHEST * error:
        return abs(value)
    sizes, means = _table()
    return float(error * np.interp(abs(value) / error, means, sizes, left=0.0))


@cache
def _table() -> tuple[Array, Array]:
    """Sizes (n,), and the means (n,) of |x| for x from normal distributions of standard deviation 1 about them."""
    sizes = np.linspace(0.0, FARTHEST, GRID)
    return sizes, np.asarray(sizes * (1.0 - 2.0 * norm.cdf(-sizes)) + 2.0 * norm.pdf(sizes))
