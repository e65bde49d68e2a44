"""Part of a predicted change that a fresh run reproduces: λ with its standard error.

Let e0 be the error of the model without the effect on the fresh run, and d the difference of the predictions of the two models.
From both, the part that may change from day to day is removed: the base model's coefficients, or only each unit's bias where the
fresh run does not determine them. Then λ = Σ dᵀV⁻¹e0 / Σ dᵀV⁻¹d is 1 if the effect is real with its fitted size, 0 if not real.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array
from inertial.data_errors.bad_dwells import bad_dwells
from inertial.data_errors.removed_dwells import without
from inertial.decisions import BLOCKS, CONFIRMED, REFUTED
from inertial.estimation.comparison import Estimate, residuals_of
from inertial.estimation.likelihood import shared_noise
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.space import Space
from inertial.estimation.term import Term

_ENOUGH = 3
"""Smallest number of units, or of time intervals, whose scatter gives a standard error."""

_SPARE = 2.0
"""Dwells per coefficient of the base model that a fresh run needs to estimate it again."""


@dataclass(frozen=True)
class ReproducedChange:
    """Evidence of a fresh run for or against an effect.

    part : λ; error : its standard error
    before, after : g, RMS errors of the models without and with the effect, without the part that may change from day to day
    fall_error : g, standard error of their difference; again : the part that was estimated again, "base" or "bias"
    """

    part: float
    error: float
    before: float
    after: float
    fall_error: float
    again: str

    @property
    def fall(self) -> float:
        """Decrease of the error, g."""
        return self.before - self.after

    @property
    def confirmed(self) -> bool | None:
        """Whether the fresh run confirms the effect (True) or refutes it (False); None where it does not decide."""
        if not np.isfinite(self.part) or not np.isfinite(self.error):
            return None
        if self.part > CONFIRMED * self.error:
            return True
        return False if self.part + 2.0 * self.error < REFUTED else None


def reproduced_change(lot: Lot, before: Estimate, after: Estimate) -> ReproducedChange:
    """The part of a predicted change that a fresh run reproduces.

    Parameters
    ----------
    lot : the fresh run, in units of the first run's scale factors
    before, after : the models without and with the effect, fitted to the first run
    """
    model = Model(Problem(lot), after.terms)
    lot = without(lot, [d.index for d in bad_dwells(model)])
    problem = Problem(lot)
    noise = Model(problem, after.terms, near=model.noise).noise
    zero = np.where(np.isfinite(problem.error), 1.0, 0.0)
    left = np.nan_to_num(residuals_of(problem, before))
    change = left - np.nan_to_num(residuals_of(problem, after))
    base, again = _base(problem, before.terms)
    space = Space(
        problem.covariance, noise, left * zero, base.local, np.concatenate([base.shared, change[..., None]], axis=-1)
    )
    shared = space.gram[1:, 1:]
    # order of the shared columns: those estimated again, then the change, whose coefficient is λ
    squares = float(shared[-1, -1])
    along = float(space.gram[-1, 0])
    if shared.shape[0] > 1:
        rest = np.linalg.pinv(shared[:-1, :-1], rcond=1e-10, hermitian=True)
        along -= float(shared[-1, :-1] @ rest @ space.gram[1:-1, 0])
        squares -= float(shared[-1, :-1] @ rest @ shared[:-1, -1])
    if squares <= 1e-9 * max(float(np.sum(space.whiten(change[..., None]) ** 2)), 1e-300):
        return ReproducedChange(float("nan"), float("nan"), *_rms_before_and_after(problem, base, left, change), again)
    wide = _common_noise_factor(Model(problem, after.terms, near=noise), space.targets[..., -1])
    return ReproducedChange(
        along / squares, float(np.sqrt(wide / squares)), *_rms_before_and_after(problem, base, left, change), again
    )


def _base(problem: Problem, terms: tuple[Term, ...]) -> tuple[Model, str]:
    """The part estimated again and its name: the complete base model if the fresh run determines it, else only the bias."""
    base = Model(problem, [t for t in terms if t.first is None])
    space = base.at(problem.covariance.white_noise())
    columns = base.local.shape[-1]
    full = bool(np.all(space.ranks == columns)) and problem.n >= _SPARE * columns
    if full:
        return base, "base"
    return _bias(problem, terms), "bias"


def without_own_bias(problem: Problem, terms: tuple[Term, ...], left: Array) -> Array:
    """Residuals (blocks, n), g, less the bias of each block in this run: it changes with every switch-on."""
    return np.where(np.isfinite(left), _fit_residuals(problem, _bias(problem, terms), np.nan_to_num(left)), np.nan)


def _bias(problem: Problem, terms: tuple[Term, ...]) -> Model:
    return Model(problem, [t for t in terms if t.effect.id == "bias"])


def _common_noise_factor(model: Model, change: Array) -> float:
    """Factor on the variance of λ for noise that the units share, by the part of the change that is common to them."""
    units = model.problem.lot.state.time.shape[0]
    if units < 2 or model.problem.lot.radial:
        return 1.0
    by_unit = change.reshape(units, model.problem.per_unit, -1)
    alike = float(units * np.sum(by_unit.mean(axis=0) ** 2) / max(float(np.sum(by_unit**2)), 1e-300))
    return 1.0 + alike * (shared_noise(model) - 1.0)


def _rms_before_and_after(problem: Problem, base: Model, left: Array, change: Array) -> tuple[float, float, float]:
    """RMS, g, before and after, and the standard error of their difference: the larger jackknife over units and intervals."""
    there = np.isfinite(problem.error)
    ends = [_fit_residuals(problem, base, series)[..., None] for series in (left, left - change)]
    both = np.where(there[..., None], np.concatenate(ends, axis=-1), 0.0) ** 2
    units = problem.lot.state.time.shape[0]
    stretch = np.arange(problem.n) * min(BLOCKS, problem.n) // problem.n
    cells = np.zeros((units, int(stretch.max()) + 1, 3))
    for k in range(cells.shape[1]):
        here = both[:, stretch == k].reshape(units, -1, int((stretch == k).sum()), 2)
        cells[:, k, :2] = here.sum(axis=(1, 2))
        cells[:, k, 2] = there[:, stretch == k].reshape(units, -1).sum(axis=1)
    before, after = (float(np.sqrt(cells[..., i].sum() / max(cells[..., 2].sum(), 1.0))) for i in (0, 1))
    spread = [_jackknife(cells.sum(axis=axis)) for axis in (0, 1) if cells.shape[1 - axis] >= _ENOUGH]
    return before, after, float(np.max(spread)) if spread else float("nan")


def _fit_residuals(problem: Problem, base: Model, series: Array) -> Array:
    """Residuals (blocks, n), g, of series after an ordinary least-squares fit of the base model's local columns."""
    level = problem.covariance.level[:, None]
    local = np.where(np.isfinite(problem.error)[..., None], base.local, 0.0) / level[..., None]
    if not local.shape[-1]:
        return series
    u, s, _ = np.linalg.svd(local, full_matrices=False)
    u = u * (s > 1e-9 * s[:, :1])[:, None, :]
    measured = np.where(np.isfinite(problem.error), series, 0.0)
    return measured - (u @ (np.swapaxes(u, -1, -2) @ measured[..., None]))[..., 0]


def _jackknife(parts: Array) -> float:
    """Jackknife standard error, g, of the decrease of the RMS; ``parts`` (k, 3): squares before and after, counts."""
    total = parts.sum(axis=0)
    rest = np.maximum(total - parts, 0.0)
    falls = np.sqrt(rest[:, 0] / np.maximum(rest[:, 2], 1.0)) - np.sqrt(rest[:, 1] / np.maximum(rest[:, 2], 1.0))
    k = len(falls)
    return float(np.sqrt((k - 1) / k * np.sum((falls - falls.mean()) ** 2)))
