"""Transverse sensitivity: the output of an axis under motion across it, over the angle of the unit (ISO 16063-31)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from inertial.errors import NotIdentified

Array = NDArray[np.float64]
FEWEST = 6
Z95 = float(norm.ppf(0.975))


@dataclass(frozen=True)
class Transverse:
    """Largest transverse sensitivity as a share of the sensitivity, and its direction.

    Attributes
    ----------
    value, error : share of the sensitivity on the axis, and its standard uncertainty
    low, high : 95 % interval; low is 0 where the transverse sensitivity is not significant
    direction_deg, direction_error_deg : from the first transverse axis towards the second; the error is 180 where it is unknown
    offset : constant over the angle: motion of the exciter along the sensitive axis
    chi_square, dof, p_value : of the residuals against the uncertainties of the points
    fitted : (n,) at the points
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
    fitted: Array


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
        msg = f"transverse sensitivity: {n} angles, {FEWEST} or more are needed; turn the unit in smaller steps"
        raise NotIdentified(msg)
    rows = np.column_stack([first, second, np.ones(n)]) / error[:, None]
    if np.linalg.cond(rows * error.mean()) > 100.0:
        msg = (
            "transverse sensitivity: the angles do not separate two directions and a constant; turn over a whole circle"
        )
        raise NotIdentified(msg)
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
        np.asarray(fitted),
    )
