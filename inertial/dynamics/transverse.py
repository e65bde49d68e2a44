"""Transverse sensitivity: the output of an axis under motion across it, over the angle of the unit (ISO 16063-31)."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from inertial.arrays import Array, Complex
from inertial.errors import NotIdentified

FEWEST = 6
ROUNDS, TURNED = 60, 1e-9
Z95 = float(norm.ppf(0.975))


@dataclass(frozen=True)
class Transverse:
    """Largest transverse sensitivity as a share of the sensitivity, and its direction.

    value, error : share of the sensitivity on the axis, and its standard uncertainty
    low, high : 95 % interval; low is 0 where the transverse sensitivity is not significant
    direction_deg, direction_error_deg : from the first transverse axis towards the second; the error is 180 where it is unknown
    offset : constant over the angle: motion of the exciter along the sensitive axis
    chi_square, dof, p_value : of the residuals against the uncertainties of the points
    """

    value: float
    error: float
    low: float
    high: float
    direction_deg: float
    direction_error_deg: float
    offset: float
    chi_square: float
    dof: int
    p_value: float


def fit_transverse(first: Array, second: Array, output: Array, error: Array) -> Transverse:
    """The largest transverse sensitivity from the components of motion along the two transverse axes.

    output = s₁·first + s₂·second + c. The motion along the sensitive axis does not turn with the unit, so it is the constant c.

    Parameters
    ----------
    first, second : (n,), motion along the two transverse axes over the driven one: cos β and sin β for an ideal exciter
    output : (n,), indicated acceleration over the driven one, in phase
    error : (n,), standard uncertainties

    Raises
    ------
    NotIdentified
        Fewer than six angles, or angles that do not separate the three unknowns.
    """
    n = len(output)
    if n < FEWEST:
        raise NotIdentified(
            f"transverse sensitivity: {n} angles, {FEWEST} or more are needed; turn the unit in smaller steps"
        )
    rows = np.column_stack([first, second, np.ones(n)]) / error[:, None]
    if np.linalg.cond(rows * error.mean()) > 100.0:
        raise NotIdentified(
            "transverse sensitivity: the angles do not separate two directions and a constant; turn over a whole circle"
        )
    covariance = np.linalg.inv(rows.T @ rows)
    c = covariance @ (rows.T @ (output / error))
    fitted = rows @ c * error
    square, dof = float(np.sum(((output - fitted) / error) ** 2)), n - 3
    size = float(np.hypot(c[0], c[1]))
    along = np.array([c[0], c[1]]) / size if size > 0.0 else np.array([1.0, 0.0])
    across = np.array([-along[1], along[0]])
    spread = float(np.sqrt(along @ covariance[:2, :2] @ along))
    turned = float(np.sqrt(across @ covariance[:2, :2] @ across))
    seen = size > 3.0 * max(turned, spread)  # without any, 1.1 % of units exceed this (Rayleigh)
    return Transverse(
        size,
        spread,
        max(0.0, size - Z95 * spread) if seen else 0.0,
        size + Z95 * spread,
        float(np.degrees(np.arctan2(c[1], c[0]))),
        float(np.degrees(turned / size)) if seen else 180.0,
        float(c[2]),
        square,
        dof,
        float(chi2.sf(square, dof)),
    )


def relative_phase(drive: Complex, answer: Complex) -> Complex:
    """Factor (n,) of magnitude one that turns the tones of each record into phase with the motion.

    A unit and the reference move and are sampled with a phase that differs from record to record. Motion along the sensitive axis
    in quadrature (an exciter has 5 %) turns it into an apparent transverse output: 1 mrad of phase into 50 ppm. The phase of a
    record is common to the three axes, so it follows from those that the motion drives. Their own cross-axis response to the same
    quadrature must not be taken for phase: answer = g·M·drive is solved for g of each record, complex, and M, real, in turn.

    Parameters
    ----------
    drive, answer : (n, 3), complex tones of the motion and of the unit

    Raises
    ------
    NotIdentified
        The unit does not answer the motion.
    """
    matrix, gain = np.eye(3), np.zeros(len(drive), dtype=np.complex128)
    inverse = np.linalg.pinv(np.concatenate([drive.real, drive.imag]))
    for _ in range(ROUNDS):
        moved, before = drive @ matrix, gain
        gain = np.sum(np.conj(moved) * answer, axis=1) / np.sum(np.abs(moved) ** 2, axis=1)
        if not np.all(np.abs(gain) > 0.0):
            raise NotIdentified("transverse sensitivity: the unit does not answer the motion; check cable and mounting")
        gain = gain * len(gain) / np.sum(np.abs(gain))  # the size belongs to the matrix
        if np.max(np.abs(gain - before)) < TURNED:
            break
        turned = answer / gain[:, None]
        matrix = inverse @ np.concatenate([turned.real, turned.imag])
    return np.asarray(np.conj(gain) / np.abs(gain), dtype=np.complex128)
