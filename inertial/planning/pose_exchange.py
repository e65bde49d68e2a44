"""Exchange of poses that maximises the information of a plan per station time: D-, A- and worst-coefficient criteria.

A plan is a sequence of slots in time, each with one candidate pose. The noise of the dwells is correlated in time, so the
information of a pose depends on when it is measured. With the weight W = C⁻¹ of the means, g = (W·H)ᵢ and δ the change of row i,
the normal matrix M = HᵀWH becomes M + δgᵀ + gδᵀ + Wᵢᵢ·δδᵀ, so that all candidates of a slot are evaluated at once.

Source: V. V. Fedorov, Theory of Optimal Experiments (1972), ch. 3 (exchange); R. K. Meyer and C. J. Nachtsheim, "The
coordinate-exchange algorithm", Technometrics 37 (1995) 60; correlated errors: U. N. Brimkulov, G. K. Krug and V. L. Savanov
(1986).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from inertial.arrays import Array, Flags, Places

Criterion = Literal["D", "A", "worst"]

_SHARPNESS = 12.0  # exponent of the power mean that approximates the worst coefficient: dominated by it, yet smooth
_OTHERS = 0.1  # weight of the other coefficients beside the worst
_RIDGE = 1e-9  # ridge as a share of the mean eigenvalue, so that the objective is finite for a singular plan
_GAIN = 1e-4  # relative gain below which an exchange is not made
_PASS_GAIN = 1e-3  # gain of a complete pass below which the search ends
_PASSES = 12


@dataclass(frozen=True)
class PlanSlots:
    """Slots of a plan and the candidates for them.

    rows : (n, c, axes, p), design rows of every candidate in every slot, in units of the required errors: error · column
    weight : (n, n), inverse of the covariance of the dwell means, 1/g²
    travel : (c, c), s, move from one candidate to another
    seconds : s, station time without moves
    group : (n,), number of the soak; poses are swapped within one soak only
    fixed : (n,), slots that are not changed
    """

    rows: Array
    weight: Array
    travel: Array
    seconds: float
    group: Places
    fixed: Flags

    def matrix(self, choice: Places) -> Array:
        """Normal matrices (axes, p, p) of a plan; the diagonal of the inverse is variance over required variance."""
        h = np.swapaxes(self.rows[np.arange(choice.size), choice], 0, 1)
        return np.swapaxes(h, -1, -2) @ (self.weight @ h)

    def duration(self, choice: Places) -> float:
        """Station time, s."""
        return self.seconds + float(np.sum(self.travel[choice[:-1], choice[1:]]))


def ratios(matrix: Array) -> Array:
    """Standard errors over the required errors, (..., axes, p), of normal matrices (..., axes, p, p)."""
    return np.sqrt(np.diagonal(_inverse(matrix), axis1=-2, axis2=-1))


def _inverse(matrix: Array) -> Array:
    p = matrix.shape[-1]
    ridge = _RIDGE * np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] / p
    return np.asarray(np.linalg.inv(matrix + ridge * np.eye(p)), dtype=np.float64)


def _d(matrix: Array) -> Array:
    """D-criterion: log of the geometric mean of the variances over the axes of the confidence ellipsoid."""
    axes, p = matrix.shape[-3:-1]
    return -np.linalg.slogdet(matrix)[1].sum(axis=-1) / (axes * p)


def _a(matrix: Array) -> Array:
    """A-criterion: log of the mean ratio of variance to required variance."""
    return np.log(np.mean(ratios(matrix) ** 2, axis=(-2, -1)))


def _worst(matrix: Array) -> Array:
    """Log of the largest ratio of variance to required variance, smoothed, plus a small weight of the others."""
    square = np.log(np.maximum(ratios(matrix) ** 2, 1e-300))
    top = square.max(axis=(-2, -1))
    smooth = np.log(np.mean(np.exp(_SHARPNESS * (square - top[..., None, None])), axis=(-2, -1))) / _SHARPNESS
    return top + smooth + _OTHERS * square.mean(axis=(-2, -1))


CRITERIA: dict[Criterion, Callable[[Array], Array]] = {"D": _d, "A": _a, "worst": _worst}


def exchanged(slots: PlanSlots, choice: Places, criterion: Criterion | Callable[[Array], Array] = "worst") -> Places:
    """A plan (n,) that no exchange of one pose and no swap of two within a soak improves in information per station time.

    Parameters
    ----------
    choice : (n,), the starting plan
    criterion : objective to minimise: "D" the volume of the confidence ellipsoid, "A" the mean square ratio to the required
        errors, "worst" the largest ratio; or a function of normal matrices (..., axes, p, p) that returns the log of a variance
    """
    value = criterion if callable(criterion) else CRITERIA[criterion]
    best = choice.copy()
    for _ in range(_PASSES):
        before = _cost(slots, best, value)
        for slot in np.flatnonzero(~slots.fixed):
            best = _replaced(slots, best, int(slot), value)
        for slot in np.flatnonzero(~slots.fixed):
            best = _swapped(slots, best, int(slot), value)
        if before - _cost(slots, best, value) < _PASS_GAIN:
            break
    return best


def _cost(slots: PlanSlots, choice: Places, value: Callable[[Array], Array]) -> float:
    """Log of variance times station time: halving either has the same effect."""
    return float(value(slots.matrix(choice))) + float(np.log(slots.duration(choice)))


def _replaced(slots: PlanSlots, choice: Places, slot: int, value: Callable[[Array], Array]) -> Places:
    """The plan with the best candidate in one slot."""
    h = slots.rows[np.arange(choice.size), choice]
    matrix = slots.matrix(choice)
    g = np.einsum("k,kap->ap", slots.weight[slot], h)
    delta = slots.rows[slot] - h[slot]
    cross = delta[..., :, None] * g[..., None, :]
    tried = matrix + cross + np.swapaxes(cross, -1, -2)
    tried += slots.weight[slot, slot] * delta[..., :, None] * delta[..., None, :]
    seconds = slots.duration(choice) + _detours(slots, choice, slot)
    cost = value(tried) + np.log(seconds)
    changed = choice.copy()
    if cost[choice[slot]] - cost.min() > _GAIN / choice.size:
        changed[slot] = int(np.argmin(cost))
    return changed


def _detours(slots: PlanSlots, choice: Places, slot: int) -> Array:
    """Change of travel time (c,), s, for every candidate in a slot."""
    total = np.zeros(len(slots.travel))
    if slot > 0:
        total += slots.travel[choice[slot - 1]]
    if slot + 1 < choice.size:
        total += slots.travel[:, choice[slot + 1]]
    return total - total[choice[slot]]


def _swapped(slots: PlanSlots, choice: Places, slot: int, value: Callable[[Array], Array]) -> Places:
    """The plan with one slot's pose swapped with the best other slot of its soak."""
    others = np.flatnonzero((slots.group == slots.group[slot]) & ~slots.fixed & (choice != choice[slot]))
    if not others.size:
        return choice
    plans = np.tile(choice, (others.size, 1))
    plans[np.arange(others.size), others] = choice[slot]
    plans[:, slot] = choice[others]
    h = slots.rows[np.arange(choice.size), choice]
    pair = np.stack([np.full(others.size, slot), others], axis=1)
    delta = slots.rows[pair, np.take_along_axis(plans, pair, axis=1)] - h[pair]
    g = np.einsum("bik,kap->biap", slots.weight[pair], h)
    inside = slots.weight[pair[:, :, None], pair[:, None, :]]
    cross = np.einsum("biap,biaq->bapq", delta, g)
    tried = slots.matrix(choice) + cross + np.swapaxes(cross, -1, -2)
    tried += np.einsum("biap,bij,bjaq->bapq", delta, inside, delta)
    seconds = slots.seconds + slots.travel[plans[:, :-1], plans[:, 1:]].sum(axis=1)
    cost = value(tried) + np.log(seconds)
    best = int(np.argmin(cost))
    return plans[best] if _cost(slots, choice, value) - cost[best] > _GAIN / choice.size else choice
