"""Per-axis polynomials: the notes' correction of one axis, and an output against temperature alone."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.distributions import chi2_tail
from inertial.errors import NotIdentified
from inertial.probability import passes
from inertial.state import T_REFERENCE

_SINGULAR = 1e-12  # eigenvalue of the scaled normal matrix below which a power is not determined
_FEWEST = 3  # samples in a block
_BLOCKS = 20  # whose means show what is slower than the noise of a sample
_LEVEL = 0.01  # over the three axes
_TIMES_NOISE = 1.25  # that may always be left: in a long record the means of blocks see any trifle


@dataclass(frozen=True)
class AxisPolynomial:
    """a = c0 + c1·ã + c2·ã² + c3·ã³ + kT·(T - T0) for each axis: from the output straight to specific force."""

    coefficients: Array
    """(..., 3, p): c0, c1, …, then kT where a temperature was given; g per power of the output unit, g/°C."""
    covariance: Array
    """(..., 3, p, p)"""
    residuals: Array
    """(..., n, 3), g"""
    degree: int
    reference_temperature: float | None

    def apply(self, output: ArrayLike, temperature: ArrayLike | None = None) -> Array:
        """Specific force (..., n, 3), g."""
        columns = _columns(np.asarray(output, dtype=np.float64), temperature, self.degree, self.reference_temperature)
        return np.einsum("...inp,...ip->...ni", columns, self.coefficients)


def fit_axis_polynomial(
    output: ArrayLike,
    force: ArrayLike,
    *,
    temperature: ArrayLike | None = None,
    degree: int = 3,
    reference_temperature: float = T_REFERENCE,
) -> AxisPolynomial:
    """Least-squares polynomial from each axis' own output to the specific force along it, units as a batch.

    What it cannot hold: cross-axis terms. Misalignment stays in the residuals, and shows there.

    Parameters
    ----------
    output : (..., n, 3), output unit
    force : (..., n, 3), g
    temperature : (..., n), °C; adds kT·(T - T0)
    degree : of the polynomial
    reference_temperature : T0, °C
    """
    raw, target = np.asarray(output, dtype=np.float64), np.asarray(force, dtype=np.float64)
    origin = reference_temperature if temperature is not None else None
    columns = _columns(raw, temperature, degree, origin)
    count, unknowns = columns.shape[-2:]
    if count <= unknowns:
        raise NotIdentified(
            f"polynomial: {number_of(count, 'dwell')}, more than {unknowns} are needed for degree {degree}; add poses"
        )
    size = np.sqrt(np.einsum("...np,...np->...p", columns, columns))
    unit = columns / np.where(size > 0.0, size, 1.0)[..., None, :]
    gram = np.swapaxes(unit, -1, -2) @ unit
    if not np.all(np.linalg.eigvalsh(gram)[..., 0] >= _SINGULAR):
        raise NotIdentified(
            f"polynomial: the poses do not determine degree {degree} on every axis; add levels of specific force"
        )
    z = np.swapaxes(np.broadcast_to(target, raw.shape), -1, -2)
    theta = np.linalg.solve(gram, np.einsum("...np,...n->...p", unit, z)[..., None])[..., 0] / size
    residual = z - np.einsum("...np,...p->...n", columns, theta)
    variance = np.sum(residual**2, axis=-1) / (count - unknowns)
    inverse = np.linalg.inv(gram) / (size[..., :, None] * size[..., None, :])
    return AxisPolynomial(theta, inverse * variance[..., None, None], np.swapaxes(residual, -1, -2), degree, origin)


def _columns(output: Array, temperature: ArrayLike | None, degree: int, origin: float | None) -> Array:
    """Design (..., 3, n, p) of each axis."""
    powers = np.stack([np.swapaxes(output, -1, -2) ** k for k in range(degree + 1)], axis=-1)
    if origin is None or temperature is None:
        return powers
    rise = np.asarray(temperature, dtype=np.float64)[..., None, :, None] - origin
    return np.concatenate([powers, np.broadcast_to(rise, (*powers.shape[:-1], 1))], axis=-1)


@dataclass(frozen=True)
class TemperatureCurve:
    """An output in one pose against temperature, judged by what its samples' noise allows."""

    coefficients: Array
    """(3, degree + 1), powers of T - T0, output unit/°Cᵏ."""
    reference_temperature: float
    rms: Array
    """(3,) of the residuals of single samples, output unit."""
    noise: Array
    """(3,) standard deviation of a sample, from first differences, output unit."""
    p_value: Array
    """(3,) probability of such slow residuals if the polynomial were right: from means of blocks in order of time."""

    @property
    def adequate(self) -> bool | None:
        """Whether the residual is what the noise explains, on every axis; None where a probability is no number."""
        unsettled = ~(self.rms <= _TIMES_NOISE * self.noise)
        return passes(self.p_value[unsettled], _LEVEL / 3.0) if unsettled.any() else True


def fit_temperature_curve(output: ArrayLike, temperature: ArrayLike, *, degree: int = 3) -> TemperatureCurve:
    """Polynomial in temperature of each axis of a record in one pose, against its sample-to-sample noise.

    The noise comes from first differences, σ² = mean (x[k+1] - x[k])²/2 (J. von Neumann, Ann. Math. Statist. 12 (1941)
    367), which slow changes hardly touch: a polynomial that misses something leaves far more than that.

    Parameters
    ----------
    output : (n, 3) in order of time, output unit
    temperature : (n,), °C
    degree : of the polynomial
    """
    x, t = np.asarray(output, dtype=np.float64), np.asarray(temperature, dtype=np.float64)
    span = float(np.ptp(t))
    if x.shape[0] < _FEWEST * _BLOCKS or span <= 0.0:
        raise NotIdentified(
            f"temperature curve: {x.shape[0]} samples over {span:.3g} °C, at least {_FEWEST * _BLOCKS} over a ramp needed"
        )
    centre = float(0.5 * (t.max() + t.min()))
    columns = chebyshev.chebvander((t - centre) / (0.5 * span), degree)
    theta = np.asarray(np.linalg.lstsq(columns, x, rcond=None)[0], dtype=np.float64)
    residuals = x - columns @ theta
    noise = np.sqrt(np.mean(np.diff(x, axis=0) ** 2, axis=0) / 2.0)
    return TemperatureCurve(
        coefficients=np.stack([_powers(theta[:, i], 0.5 * span) for i in range(x.shape[1])]),
        reference_temperature=centre,
        rms=np.sqrt(np.sum(residuals**2, axis=0) / (x.shape[0] - degree - 1)),
        noise=noise,
        p_value=_slow(residuals, noise, degree),
    )


def _powers(theta: Array, half_span: float) -> Array:
    """Coefficients of the powers of T - T0 from those of Chebyshev polynomials on the span."""
    plain = np.zeros(theta.size)
    converted = chebyshev.cheb2poly(theta)
    plain[: converted.size] = converted
    return plain / half_span ** np.arange(theta.size)


def _slow(residuals: Array, noise: Array, degree: int) -> Array:
    """Chi-square test of the means of blocks against the noise of a mean."""
    usable = residuals.shape[0] // _BLOCKS * _BLOCKS
    blocks = residuals[:usable].reshape(_BLOCKS, -1, residuals.shape[1])
    statistic = np.sum(blocks.mean(axis=1) ** 2, axis=0) / (noise**2 / blocks.shape[1])
    return chi2_tail(statistic, _BLOCKS - degree - 1)
