"""Fit of a transfer function: sensitivity times effects, each point weighted by its own uncertainty in magnitude and phase."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from inertial.arrays import Array, Complex, Flags
from inertial.dynamics.missing_effects import p_value
from inertial.dynamics.transfer_effects import EFFECTS, Conditions, Parameter, TransferEffect
from inertial.dynamics.transfer_effects.base import Coordinates
from inertial.errors import NotIdentified

MOST_STARTS = 1200  # combinations whose residual is looked at: it costs less than a step of a search
SCREENED = 6  # of them that are searched from, those with the least residual
POLISHED = 2  # of them that are carried to the end
A_FEW, TO_THE_END = 12, 150  # steps
PLAIN = Conditions(np.ones(2), np.ones(2), np.array([0.0, 1.0]), np.ones(2))
"""Points at which every effect has its parameters."""
PORTION = 64  # models evaluated at once
EPSILON = float(np.finfo(np.float64).eps)
PREDICTION_STEP = 1e-6
"""Of a coordinate, for the central differences of a prediction: near the cube root of the machine's precision."""
HELD_WITHIN = 1e-7
"""Half the range of the logarithm of a parameter that is held: a search needs one."""
IDENTIFIED_SHARE = 0.2
"""Largest relative standard uncertainty at which a frequency or damping counts as identified."""


@dataclass(frozen=True)
class Points:
    """A measured transfer function.

    conditions : frequency, level, temperature and duration of the points
    value : (n,), complex, output per g
    magnitude_error : (n,), standard uncertainty of the magnitude as a share of it, without what all points share
    phase_error : (n,), standard uncertainty of the phase, rad
    """

    conditions: Conditions
    value: Complex
    magnitude_error: Array
    phase_error: Array

    def picked(self, rows: Flags) -> "Points":
        """Some of the points."""
        return Points(
            self.conditions.picked(rows), self.value[rows], self.magnitude_error[rows], self.phase_error[rows]
        )


@dataclass(frozen=True)
class TransferFit:
    """A fitted model.

    effects : ids of the effects besides the sensitivity
    sensitivity : output per g at low frequency, with the sign of the polarity; sensitivity_error : as a share
    parameters : of all effects in order; values, errors : (p,), errors of a log parameter are shares of the value
    chi_square, dof : of the weighted residuals
    residual : (2n,), weighted: log magnitude, then phase
    """

    effects: tuple[str, ...]
    sensitivity: float
    sensitivity_error: float
    parameters: tuple[Parameter, ...]
    values: Array
    errors: Array
    chi_square: float
    dof: int
    residual: Array
    covariance: Array = field(repr=False)

    @property
    def p_value(self) -> float:
        """Probability of a larger χ² where the model is right."""
        return p_value(self)

    def of(self, name: str) -> tuple[float, float, float, float]:
        """Value, standard uncertainty, and the ends of the 95 % interval of a parameter, in its unit."""
        k = [p.name for p in self.parameters].index(name)
        value, error = float(self.values[k]), float(self.errors[k])
        if not self.parameters[k].log:
            return value, error, value - 1.96 * error, value + 1.96 * error
        reach = 1.96 * min(error, 20.0)
        return value, value * error, value * float(np.exp(-reach)), value * float(np.exp(reach))

    @property
    def known(self) -> dict[str, float]:
        """The values of the parameters by name."""
        return {p.name: float(v) for p, v in zip(self.parameters, self.values, strict=True)}

    def identified(self, name: str) -> bool:
        """Whether a log parameter is known to a fifth, or another differs from 0 by three standard uncertainties."""
        k = [p.name for p in self.parameters].index(name)
        if self.parameters[k].log:
            return bool(self.errors[k] < IDENTIFIED_SHARE)
        return bool(abs(self.values[k]) > 3.0 * self.errors[k])

    def response(self, conditions: Conditions) -> Complex:
        """The model at some points, output per g."""
        return self.sensitivity * factor(self.effects, conditions, self.values)

    def predicted(self, conditions: Conditions) -> tuple[Complex, Array, Array]:
        """The model at some points, and the standard uncertainty of its log magnitude and of its phase there, all (n,)."""
        coordinates = Coordinates(self.parameters)
        at, factor_at = coordinates.of(self.values), factor_of(self.effects, conditions)
        middle = self.sensitivity * factor_at(self.values)

        def logarithm(x: Array) -> Complex:
            with np.errstate(all="ignore"):
                return np.log(self.sensitivity * factor_at(coordinates.values(x)) / middle)

        steps = np.diag(PREDICTION_STEP * np.maximum(1.0, np.abs(at)))
        slopes = [np.ones(len(middle), dtype=np.complex128)]
        slopes += [(logarithm(at + h) - logarithm(at - h)) / (2.0 * h.max()) for h in steps]
        jacobian = np.nan_to_num(np.stack(slopes, axis=1))
        magnitude, phase = (np.einsum("np,pq,nq->n", j, self.covariance, j) for j in (jacobian.real, jacobian.imag))
        return middle, np.sqrt(np.maximum(magnitude, 0.0)), np.sqrt(np.maximum(phase, 0.0))

    def logarithmic(self, name: str) -> bool:
        """Whether a parameter is positive and fitted by its logarithm."""
        return next(p.log for p in self.parameters if p.name == name)

    def frequencies_of(self, name: str) -> tuple[str, ...]:
        """The frequencies among the parameters of the effect to which a parameter belongs."""
        at = 0
        for effect in self.effects:
            parameters = self.parameters[at : at + len(EFFECTS[effect].parameters(PLAIN))]
            if any(p.name == name for p in parameters):
                return tuple(p.name for p in parameters if p.unit == "Hz")
            at += len(parameters)
        return ()

    def has(self, name: str) -> bool:
        """Whether the model has a parameter of this name."""
        return any(p.name == name for p in self.parameters)


def factor(effects: Sequence[str], conditions: Conditions, values: Array) -> Complex:
    """Product of the effects' factors (n,) for parameter values (p,) in order."""
    return factor_of(effects, conditions)(values)


def factor_of(effects: Sequence[str], conditions: Conditions) -> Callable[[Array], Complex]:
    """The product of the effects' factors at some points, as a function of the parameter values in order.

    Values (p,) give the product (n,), values (p, k, 1) of k models at once (k, n).
    """
    owned: list[tuple[TransferEffect, tuple[str, ...], slice]] = []
    at, count = 0, len(conditions.frequency)
    for name in effects:
        names = tuple(p.name for p in EFFECTS[name].parameters(conditions))
        owned.append((EFFECTS[name], names, slice(at, at + len(names))))
        at += len(names)

    def product(values: Array) -> Complex:
        changes: dict[str, Array] = {}
        for effect, _, part in owned:
            for parameter, ratio in effect.changes(conditions, values[part]).items():
                changes[parameter] = changes.get(parameter, np.ones(1)) * ratio
        out: Complex = np.ones(count, dtype=np.complex128)
        for effect, names, part in owned:
            changed = values[part]
            if changes and any(name in changes for name in names):
                ratios = [changes.get(name, np.ones(1)) for name in names]
                changed = np.stack([v * ratio * np.ones(count) for v, ratio in zip(changed, ratios, strict=True)])
            out = out * effect.factor(conditions, changed)
        return out

    return product


def fit_transfer(
    points: Points,
    effects: Sequence[str],
    near: Mapping[str, float] | None = None,
    *,
    only_near: bool = False,
    steps: int = TO_THE_END,
    held: str = "",
) -> TransferFit:
    """The best fit of a model over several starts.

    Parameters
    ----------
    effects : ids of the effects; the sensitivity is always fitted
    near : values of parameters at which the search starts, by name, as those of a smaller model
    only_near : whether these parameters start there alone: the model describes the points already
    steps : most of the last search; few will do for some of the points that gave ``near``
    held : a log parameter that stays at its value of ``near``: it has no uncertainty, and costs no degree of freedom

    Raises
    ------
    NotIdentified
        The points are fewer than the parameters need.
    """
    conditions = points.conditions
    parameters = tuple(p for name in effects for p in EFFECTS[name].parameters(conditions))
    if 2 * len(points.value) < len(parameters) + 2:
        raise NotIdentified(
            f"transfer function: {len(points.value)} points for {len(parameters) + 1} parameters; sweep more frequencies"
        )
    low_end = np.argsort(conditions.frequency)[: max(3, len(points.value) // 5)]
    sign = -1.0 if np.median(np.abs(np.angle(points.value[low_end]))) > 0.5 * np.pi else 1.0
    coordinates, factor_at = Coordinates(parameters), factor_of(effects, conditions)
    bounds = np.append(-np.inf, coordinates.low), np.append(np.inf, coordinates.high)
    free = np.append(True, [p.name != held for p in parameters])
    for bound, width in zip(bounds, (-HELD_WITHIN, HELD_WITHIN), strict=True):
        bound[~free] = np.log((near or {}).get(held, 1.0)) + width
    error = np.concatenate([points.magnitude_error, points.phase_error])

    def deviation(x: Array) -> Array:
        """Of the logarithm of the magnitude and of the phase, (…, 2n), for coordinates (…, p + 1)."""
        values = coordinates.values(x[..., 1:])
        with np.errstate(all="ignore"):
            ratio = points.value / (sign * np.exp(x[..., :1]) * factor_at(values.T[..., None]))
            out = np.concatenate([np.log(np.abs(ratio)), np.angle(ratio)], axis=-1)
        return np.nan_to_num(out, copy=False, nan=1e6, posinf=1e6, neginf=-1e6)

    def residual(x: Array) -> Array:
        return np.clip(deviation(x) / error, -1e6, 1e6)

    def slopes(x: Array) -> Array:
        steps = _one_sided_steps(x, *bounds)
        return np.asarray(((residual(x + np.diag(steps)) - residual(x)) / ((x + steps) - x)[:, None]).T)

    def searched(start: Array, most: int) -> OptimizeResult:
        of_slopes: Any = slopes  # the stubs of scipy know the names of methods alone
        return least_squares(residual, start, jac=of_slopes, bounds=bounds, max_nfev=most, x_scale="jac")

    level = float(np.log(np.median(np.abs(points.value[low_end]))))

    def starts(*, alone: bool) -> Array:
        return np.array(
            [np.append(level, coordinates.of(start)) for start in _starts(parameters, near or {}, only_near=alone)]
        )

    def least(candidates: Array, remaining: Callable[[Array], Array]) -> list[Array]:
        return list(candidates[np.argsort(_in_portions(remaining, candidates), kind="stable")[:SCREENED]])

    # far from the solution all points are off by many of their uncertainties: starts are compared by the deviation itself
    screened = [] if only_near else least(starts(alone=False), lambda x: np.sum(deviation(x) ** 2, axis=-1))
    # beside a known model by what a step leaves: a narrow mode is seen where its frequency is right, whatever its size
    screened += least(starts(alone=True), lambda x: _after_a_step(residual, x)) if near else []
    tried = sorted((searched(start, A_FEW) for start in screened), key=lambda fit: fit.cost)
    done = [searched(start.x, steps) for start in tried[:POLISHED]]
    best = min(done, key=lambda fit: fit.cost)
    jacobian = np.where(free, best.jac, 0.0)
    covariance = np.asarray(np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-15))
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    left = residual(best.x)
    return TransferFit(
        tuple(effects),
        float(sign * np.exp(best.x[0])),
        float(errors[0]),
        parameters,
        coordinates.values(best.x[1:]),
        errors[1:],
        float(left @ left),
        len(left) - int(np.count_nonzero(free)),
        left,
        covariance,
    )


def _one_sided_steps(x: Array, low: Array, high: Array) -> Array:
    """Steps (p,) of a slope by differences at ``x`` (p,): away from zero, and within the bounds (p,)."""
    steps = np.sqrt(EPSILON) * np.where(x >= 0.0, 1.0, -1.0) * np.maximum(1.0, np.abs(x))
    outside = (x + steps < low) | (x + steps > high)
    below, above = x - low, high - x
    narrow = np.abs(steps) > np.maximum(below, above)
    return np.where(narrow, np.where(above >= below, above, -below), np.where(outside, -steps, steps))


def _in_portions(function: Callable[[Array], Array], x: Array) -> Array:
    """A function of many coordinates (k, p), with as many at once as a processor keeps near."""
    return np.concatenate([function(x[at : at + PORTION]) for at in range(0, len(x), PORTION)])


def _after_a_step(residual: Callable[[Array], Array], starts: Array) -> Array:
    """Sums of squares (k,) that a linear step from each of some starts (k, p) is expected to leave."""
    size = starts.shape[-1]
    left = residual(starts)
    ahead = residual((starts[:, None] + np.diag(np.full(size, 1e-5))).reshape(-1, size)).reshape(len(starts), size, -1)
    jacobians = np.swapaxes((ahead - left[:, None]) / 1e-5, 1, 2)
    return np.array(
        [
            np.sum((to_explain - jacobian @ np.linalg.lstsq(jacobian, to_explain, rcond=1e-10)[0]) ** 2)
            for jacobian, to_explain in zip(jacobians, left, strict=True)
        ]
    )


def exchanged(points: Points, fit: TransferFit) -> TransferFit | None:
    """The solution with sprung mass and two-pole low-pass exchanged; None where the model has not both.

    At ζ near 0.7071 both are alike, and a sweep hardly tells which of them is the mass.
    """
    if not (fit.has("natural_hz") and fit.has("two_pole_hz")):
        return None
    near = fit.known
    near |= {"natural_hz": near["two_pole_hz"], "two_pole_hz": near["natural_hz"], "damping": float(np.sqrt(0.5))}
    return fit_transfer(points, fit.effects, near, only_near=True)


def best_of_exchange(points: Points, fit: TransferFit) -> tuple[TransferFit, TransferFit | None]:
    """The better of both solutions, and the other one where the points do not exclude it (χ² less than 9 larger)."""
    other = exchanged(points, fit)
    if other is None or abs(np.log(other.of("natural_hz")[0] / fit.of("natural_hz")[0])) < 0.02:
        return fit, None
    first, second = sorted((fit, other), key=lambda solution: solution.chi_square)
    return first, second if second.chi_square - first.chi_square < 9.0 else None


def _starts(parameters: Sequence[Parameter], near: Mapping[str, float], *, only_near: bool) -> list[Array]:
    """Combinations of the parameters' starts, thinned, within their bounds."""
    choices = [
        ((near[p.name],) if only_near else (near[p.name], *p.starts)) if p.name in near else p.starts
        for p in parameters
    ]
    if not choices:
        return [np.zeros(0)]
    sizes = [len(choice) for choice in choices]
    count = math.prod(sizes)
    chosen = np.unravel_index(np.arange(0, count, max(1, -(-count // MOST_STARTS))), sizes)
    low = np.array([p.low * (1.0 + 1e-9) if p.log else p.low for p in parameters])
    high = np.array([p.high for p in parameters])
    every = np.stack([np.array(choice)[at] for choice, at in zip(choices, chosen, strict=True)], axis=1)
    return list(np.minimum(np.maximum(every, low), high))
