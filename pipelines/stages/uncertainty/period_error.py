"""Errors of a unit over the period of validity: the RMS expected of each axis, and the distribution of the largest of the three.

A use at the end of the period meets, on each axis, what the model left in the run, noise like that of the run, a change of the
bias (flicker, random walk, switching on, ageing), a change of the scale, and the errors of the references. What is known of them
is a standard deviation each, so the RMS of an axis is a root of a sum of squares with few degrees of freedom, and the largest of
three axes lies well above the RMS that is expected of one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit
from scipy.stats import qmc

from schemas.decisions import BOUND_SHARE

Array = NDArray[np.float64]

DRAWS = 2048
OF_AXIS = 4
"""Numbers drawn for each axis: noise, change of the bias, switching on, scale."""
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class AxisErrors:
    """What makes the error of one axis in a use, (units,) each where not said otherwise; µg.

    run, mean : RMS and mean of the errors of the verification
    expected, dof : RMS of a correct model, and degrees of freedom of its square
    fixed : standard deviation by the references, as far as the verification cannot show them; form : (q, q), mean square of the
        errors over the poses as a quadratic form of independent normal influences, of any scale
    later : standard deviations of the changes after the run, by name; of ``switch_on_scale`` the RMS over the poses
    """

    run: Array
    expected: Array
    dof: Array
    mean: Array
    fixed: Array
    form: Array
    later: dict[str, Array] = field(default_factory=dict[str, "Array"])

    @property
    def value(self) -> Array:
        """RMS error expected, µg."""
        return np.sqrt(self.run**2 + self.fixed**2 + np.sum([part**2 for part in self.later.values()], axis=0))


def largest_error(axes: list[AxisErrors], switch_on_dof: float) -> tuple[Array, Array]:
    """Median and 95 % bound of the largest RMS error of the axes in a use, (units,) each, µg.

    Parameters
    ----------
    switch_on_dof : degrees of freedom that the scatter of switching on is known from
    """
    units, q = axes[0].run.size, axes[0].form.shape[0]
    uniform = _uniform(q + OF_AXIS * len(axes))
    influences = ndtri(uniform[:, :q])
    out = np.zeros((2, units))
    forms = [_form(axis, influences) for axis in axes]
    own = [uniform[:, q + OF_AXIS * k : q + OF_AXIS * (k + 1)] for k in range(len(axes))]
    normal = [ndtri(columns) for columns in own]
    again = [stdtrit(switch_on_dof, columns[:, 2]) for columns in own]
    for unit in range(units):
        largest = np.zeros(DRAWS)
        for axis, form, z, switched in zip(axes, forms, normal, again, strict=True):
            np.maximum(largest, _square(axis, unit, form, z, switched), out=largest)
        out[:, unit] = np.sqrt(np.quantile(largest, (0.5, BOUND_SHARE)))
    return out[0], out[1]


def _square(axis: AxisErrors, unit: int, form: Array, z: Array, switched: Array) -> Array:
    """Draws of the mean square error of an axis of a unit, µg²."""
    later = {name: float(values[unit]) for name, values in axis.later.items()}
    scale, on = later.pop("switch_on_scale", 0.0), later.pop("switch_on", 0.0)
    moved = np.sqrt(sum(value**2 for value in later.values())) * z[:, 1] + on * switched
    noise = float(axis.expected[unit]) ** 2 * _chi_squared(float(axis.dof[unit]), z[:, 0])
    left = max(float(axis.run[unit] ** 2 - axis.expected[unit] ** 2), 0.0)
    mean = float(axis.mean[unit]) * np.sqrt(left) / max(float(axis.run[unit]), _TINY)
    return left + 2.0 * mean * moved + moved**2 + noise + (scale * z[:, 3]) ** 2 + float(axis.fixed[unit]) ** 2 * form


def _form(axis: AxisErrors, influences: Array) -> Array:
    """Draws of the square of what the references make, of mean one."""
    trace = float(np.trace(axis.form))
    if not trace > 0.0:
        return np.ones(len(influences))
    return np.einsum("nq,nq->n", influences @ axis.form, influences) / trace


def _chi_squared(dof: float, z: Array) -> Array:
    """χ²/ν at normal values z (Wilson and Hilferty, Proc. Nat. Acad. Sci. 17 (1931) 684); zero below its range."""
    part = 2.0 / (9.0 * max(dof, 0.5))
    return np.maximum(1.0 - part + np.sqrt(part) * z, 0.0) ** 3


@lru_cache(maxsize=8)
def _uniform(count: int) -> Array:
    """The same well-spread draws every time: a decision that is made again is the same."""
    draws = qmc.Sobol(count, scramble=True, rng=np.random.default_rng(20260101)).random(DRAWS)
    return np.clip(draws, 1e-9, 1.0 - 1e-9)
