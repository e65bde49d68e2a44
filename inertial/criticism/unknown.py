"""Effects outside the catalogue: a curve of one driver that explains a lot better than the effects that imitate it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inertial import decisions, frames
from inertial.arrays import Array
from inertial.criticism.curves import CurveFit, fit_curves
from inertial.criticism.drivers import (
    Driver,
    Part,
    across,
    curve,
    forces_along,
    own_forces,
    quantities,
    transfer,
    varies,
)
from inertial.design import of_axes
from inertial.effects.covariate import COVARIATE_PREFIX
from inertial.estimation.alternative import by_block, of_outputs, rotated_force
from inertial.estimation.candidate import Candidate
from inertial.estimation.likelihood import restricted_deviance, shared_noise
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.penalty import PER_COEFFICIENT, PER_COLUMN, cost_of_model, log_p_value, price
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
from inertial.quantities import is_clock

_KNOTS = 9  # of a smooth curve over a driver
_TIME_KNOTS = 12  # of a curve over time
_FEW_KNOTS = 6  # of a smooth dependence of the scale factors
_WIDE_KNOTS = 6  # of a smooth curve of the misalignment
_TURNED_KNOTS = 2  # of a curve of the fixture's rotation, with three coefficients of the lot per column
_FORCE_KNOTS = 7  # of a curve over the force along an axis
_HARMONICS = 5  # of a table angle
_CYCLES = np.arange(1.0, 14.1, 0.5)  # numbers of cycles of an oscillation over the run
_BETWEEN = (0.125, 0.05, 0.02)  # successive steps of the number of cycles in its refinement
_LEVELS = 14  # number of groups of values from which on a driver is continuous
_VISITS = 1.5  # smallest mean number of visits to each level
_CENTRES = np.linspace(0.0, 1.0, 21)  # of bumps and hinges, over the driver's range
_WIDTHS = (0.02, 0.05, 0.1)  # of bumps, as shares of that range
_PROMISING = 6  # suspects at each noise whose curves are fitted
_SHARPEST = 3  # suspects that are tested with bumps and hinges


@dataclass(frozen=True)
class Unexplained:
    """A driver that the output depends on, without an effect of the catalogue that explains the dependence.

    log_p : natural logarithm of the probability that noise shows as strong a dependence
    part : property of the output that depends on it; model : the model with the dependence; None where there is none
    floor : g, noise of the measurement with the dependence in the model
    period : s, period of an oscillation in time; None for any other curve
    """

    driver: str
    shape: str
    log_p: float
    part: Part = "bias"
    floor: float = float("inf")
    model: Model | None = field(default=None, compare=False, repr=False)
    period: float | None = None


def suspects(problem: Problem) -> list[Driver]:
    """Every driver that varies in a lot, with columns flexible enough for any smooth dependence on it."""
    state = problem.lot.state
    suspected: list[Driver] = []
    for name, values, _ in quantities(state):
        if varies(values) and not (name == "chamber_C" and alike(values, state.temperature)):
            knots = _TIME_KNOTS if is_clock(name) else _KNOTS
            each = _unit_range(values if problem.lot.radial else np.repeat(values, problem.per_unit, axis=0))
            suspected.append(Driver(name, _on_every_axis(problem, curve(values, knots)), each))
            # no levels in time: with one for each soak they could follow any memory of temperature
            steps = None if is_clock(name) else _levels(values)
            if steps is not None:
                suspected.append(Driver(name, _on_every_axis(problem, steps)))
            if not problem.lot.radial and knots > 2:
                # a dependence of the scale factors: the curve is multiplied by the force along each axis
                suspected.append(Driver(name, _columns(along_force(problem, curve(values, _FEW_KNOTS))), part="scale"))
    if not problem.lot.radial:
        force = own_forces(problem).reshape(problem.blocks, problem.n)
        if varies(force):
            suspected.append(Driver("pose", _columns(curve(force, _KNOTS)), _unit_range(force)))
        suspected += _table(problem)
    duration = max(float(np.ptp(state.time)), 1.0)
    return [*suspected, *(_oscillation(problem, duration / cycles) for cycles in _CYCLES)]


def wide_suspects(problem: Problem) -> list[Driver]:
    """For every driver that varies in a lot, curves of misalignment, of the fixture's rotation and of the transfer curve.

    Because of their many columns they are suspected only where several causes, also handling errors, were found together.
    """
    if problem.lot.radial:
        return []
    state = problem.lot.state
    along = forces_along(problem)
    rotated = rotated_force(problem.lot)
    suspected: list[Driver] = []
    for name, values, _ in quantities(state):
        if not varies(values) or (name == "chamber_C" and alike(values, state.temperature)):
            continue
        driver_curve = curve(values, _WIDE_KNOTS)  # (units or 1, n, d)
        if driver_curve.shape[-1] < 2:  # a line, or levels that handling errors already are
            continue
        suspected.append(Driver(name, _columns(across(along, driver_curve, problem.axes)), ways=2, part="axes"))
        turned = rotated[..., :, None] * curve(values, _TURNED_KNOTS + is_clock(name))[:, :, None, None, :]
        changes = np.broadcast_to(turned, (problem.blocks // problem.per_unit, *turned.shape[1:]))
        columns = by_block(of_outputs(problem.lot, changes.reshape(*changes.shape[:3], -1)))
        suspected.append(Driver(name, _columns(columns, shared=True), part="axes"))
        if varies(own_forces(problem)):
            columns = transfer(of_axes(along, problem.axes, 1), values, _FORCE_KNOTS)
            suspected.append(Driver(name, _columns(columns), part="transfer"))
    return suspected


def better_curve(
    base: Model, chosen: Sequence[Term], field: Sequence[Driver], alike: Sequence[Term] = ()
) -> tuple[CurveFit, list[Term]] | None:
    """The curve that explains the lot better than chosen effects, and the effects that remain beside it; None if none does.

    Parameters
    ----------
    alike : effects that explain as much as a single chosen one, of which some have fewer coefficients
    """
    held = {t.effect.id.removeprefix(COVARIATE_PREFIX) for t in chosen}
    full = Model(base.problem, [*base.terms, *chosen], near=base.noise)
    base_cost = cost_of_model(base)
    every = _promising(base, field)
    promising = [s for s in every if s.name not in held]
    fits = list(zip(fit_curves(base, promising, [*_noises(base), full.noise]), promising, strict=True))
    fits += [(f, s) for s in promising[:_SHARPEST] if (f := _sharp(base, s)) is not None]
    if not fits:
        return None
    best, suspect = min(fits, key=lambda pair: pair[0].cost)
    if best.cost >= base_cost:
        return None  # the units together show an effect that each of them does not
    if any(fit.cost <= best.cost for fit in fit_curves(base, [s for s in every if s.name in held])):
        return None  # a covariate that the chosen effects already contain fits as well with a free curve
    remaining: list[Term] = []
    if len(chosen) > 1:
        # the first two suspects of the driver: a smooth dependence of the bias, and levels
        tried = [s for s in field if s.name == suspect.name and s.ways == 1][:2] if suspect.ways == 1 else [suspect]
        worth = max(decisions.CURVE_AHEAD, decisions.CURVE_SHARE * (base_cost - best.cost))
        best, remaining = _with_others(base, chosen, tried, best, worth)
    replaced = [t for t in chosen if t not in remaining]
    ahead = decisions.CURVE_AHEAD / len(replaced) if 0 < len(replaced) < 3 else 0.0
    if not replaced or best.cost + ahead >= _cost_beside(full, best):
        return None  # up to two effects have priority over a curve that is not clearly better
    # an effect with memory is also compared alone: its inexact shape often leaves residuals that further effects explain
    rivals = [t for t in replaced if t.effect.memory or len(replaced) == 1]
    priority = any(_nearly_as_good(base, [*remaining, t], best) for t in [*rivals, *alike])
    return None if priority else (best, remaining)


def _cost_beside(model: Model, curve: CurveFit) -> float:
    """The cost of a model at its own noise or at that beside a curve, whichever is less.

    Where few soaks leave the slow noise open, the two estimates of it differ, and the cost with them by more than any effect.
    """
    return min(cost_of_model(model), cost_of_model(model.held_at(curve.model.noise.shares)))


def _nearly_as_good(base: Model, terms: Sequence[Term], curve: CurveFit) -> bool:
    """Whether effects, the last of which is in question, gain so nearly as much as a curve that they have priority."""
    # a curve over time can follow any memory of one run
    share = (3.0 if terms[-1].effect.memory else 1.0) * decisions.CURVE_SHARE
    gain, alone = cost_of_model(base) - curve.cost, Model(base.problem, [*base.terms, *terms], near=base.noise)
    return curve.cost >= _cost_beside(alone, curve) - max(decisions.CURVE_AHEAD, share * gain)


def curve_in_noise(base: Model, field: Sequence[Driver]) -> CurveFit | None:
    """The curve that explains far better, with the noise estimated again, what a model attributes to noise; None if none.

    A tide common to all units is not a random walk, and relaxation after each move is not increased noise; but in a model without
    them the estimated noise includes them, so that no test at that noise detects them.
    """
    fits = fit_curves(base, _promising(base, field), _noises(base))
    if not fits:
        return None
    best = _tuned(base, min(fits, key=lambda f: f.cost))
    before, after, shared = base.at(best.model.noise), best.model.space, shared_noise(best.model)
    # error contrasts: a model without a walk would save its variance along the bias of every block, which has no residual
    gain = restricted_deviance(base.space, base.space) - restricted_deviance(before, after)
    # noise that the units share follows a curve by chance in all units at once
    gain *= max(before.dof - best.rank, 0) / max(before.dof, 1) / shared
    # coefficients along a slow noise cost, at less noise, what that noise costs in the likelihood
    each = max(PER_COEFFICIENT * best.rank, price(_fall(base, best) / after.variance / shared, best.rank))
    paid = each + PER_COLUMN * (best.model.local.shape[-1] - base.local.shape[-1])
    return best if gain - paid > 0.5 * decisions.CURVE_AHEAD else None


def unexplained_by(base: Model, fit: CurveFit, looks: int) -> Unexplained:
    """The unexplained dependence that a curve, the best of ``looks`` curves, shows in a model."""
    log_p = log_p_value(base.at(fit.model.noise), _fall(base, fit), fit.rank) + float(np.log(looks))
    driver = fit.driver
    return Unexplained(driver.name, "curve", log_p, driver.part, fit.model.floor(), fit.model, driver.period)


def _fall(base: Model, fit: CurveFit) -> float:
    """Reduction of the sum of squares by a curve, at the noise of the model with it."""
    return max(base.at(fit.model.noise).rss - fit.model.space.rss, 0.0)


def _noises(base: Model) -> list[Noise]:
    """The noise of a model, and one with less wander, because the estimated wander may have absorbed a curve."""
    less = base.noise.shares.times(decisions.LESS_FLICKER, decisions.LESS_WALK)
    return [base.noise] if less == base.noise.shares else [base.noise, base.noise_at(less)]


def _promising(base: Model, field: Sequence[Driver]) -> list[Driver]:
    """The suspects whose curves, free in each block, reduce the residuals most, at a model's noise and with less wander."""
    picked: dict[int, Driver] = {}
    for noise in _noises(base):
        space = base.at(noise)
        worth = [float(np.max(space.gain(s.candidate).drop)) for s in field]
        picked |= {int(i): field[i] for i in np.argsort(worth)[::-1][:_PROMISING] if worth[i] > 0.0}
    return list(picked.values())


def _with_others(
    base: Model, chosen: Sequence[Term], suspect: Sequence[Driver], best: CurveFit, worth: float
) -> tuple[CurveFit, list[Term]]:
    """The best curve, and the chosen effects that are no functions of its driver and reduce the cost by more than ``worth``."""
    remaining: list[Term] = []
    for term in chosen:
        if _function_of(base, term, suspect[0]):
            continue
        beside = Model(base.problem, [*base.terms, *remaining, term], near=base.noise)
        tried = fit_curves(beside, suspect)
        tried += [f for s in suspect[:1] if (f := _sharp(beside, s)) is not None]
        again = min(tried, key=lambda f: f.cost)
        if again.cost < best.cost - worth:
            best, remaining = again, [*remaining, term]
    return best, remaining


def _function_of(base: Model, term: Term, suspect: Driver) -> bool:
    """Whether a flexible curve of the driver, block by block, reproduces nine tenths of a term's columns."""
    columns = term.columns(base.problem)
    before = base.at(base.problem.covariance.white_noise())
    local = np.concatenate([base.local, suspect.candidate.at(0)], axis=-1)
    after = type(before)(before.covariance, before.noise, base.problem.y, local, base.shared)
    left = [float(np.sum(s.project(s.whiten(columns)) ** 2)) for s in (before, after)]
    return left[1] < 0.1 * left[0]


def _sharp(model: Model, suspect: Driver) -> CurveFit | None:
    """The best bump, hinge or step of a driver added to a model: features narrower than a smooth curve can follow."""
    if suspect.values is None:
        return None
    z = suspect.values
    shapes = [np.exp(-0.5 * ((z - c) / w) ** 2) for w in _WIDTHS for c in _CENTRES]
    shapes += [np.maximum(z - c, 0.0) for c in _CENTRES] + [(z > c).astype(float) for c in _CENTRES]
    columns = np.stack(shapes, axis=-1)
    gain = model.space.gain(Candidate(columns[..., None], shared=False))
    best = int(np.argmax(gain.drop))
    if not gain.rank[best]:
        return None
    column = columns[..., best : best + 1]
    if best < len(_WIDTHS) * len(_CENTRES):
        column = _refined_bump(model, z, _CENTRES[best % len(_CENTRES)], _WIDTHS[best // len(_CENTRES)])
    fitted = model.with_curves(column)
    cost = cost_of_model(fitted) + 2.0 * PER_COEFFICIENT
    return CurveFit(Driver(suspect.name, _columns(column)), fitted, int(gain.rank[best]) + 2, cost)


def _refined_bump(model: Model, z: Array, centre: float, width: float) -> Array:
    """Column (blocks, n, 1) of a bump, with position and width refined between the values of the grid."""
    space = model.space
    column = np.zeros(0)
    for reach in (0.5, 0.2):
        pairs = [
            (centre + reach * dc * 0.05, width * (1.0 + reach) ** dw)
            for dc in (-1, -0.5, 0, 0.5, 1)
            for dw in (-1, 0, 1)
        ]
        columns = np.stack([np.exp(-0.5 * ((z - c) / w) ** 2) for c, w in pairs], axis=-1)
        best = int(np.argmax(space.gain(Candidate(columns[..., None], shared=False)).drop))
        (centre, width), column = pairs[best], columns[..., best : best + 1]
    return column


def _unit_range(values: Array) -> Array:
    """Values scaled to 0 … 1 over the run."""
    return (values - values.min()) / max(float(np.ptp(values)), 1e-12)


def alike(values: Array, other: Array | None) -> bool:
    """Whether two quantities are equivalent (correlation above 0.98), as chamber and sensor temperature after soaks."""
    return other is not None and float(np.corrcoef(values.ravel(), other.ravel())[0, 1]) > 0.98


def _levels(values: Array) -> Array | None:
    """Steps (units, n, d) between neighbouring groups of values, if these form a few groups such as soaks; else None."""
    order = np.sort(values, axis=None)
    gaps = np.diff(order)
    edges = order[:-1][gaps > 0.03 * np.ptp(order)] + 0.5 * gaps[gaps > 0.03 * np.ptp(order)]
    if not 2 <= edges.size < _LEVELS:
        return None
    level = np.searchsorted(edges, values[0])
    visits = 1 + int(np.count_nonzero(np.diff(level)))
    if visits < _VISITS * (edges.size + 1):
        return None  # levels visited only once are free offsets, which could follow any memory
    return np.stack([(values > e).astype(float) for e in edges], axis=-1)


def _on_every_axis(problem: Problem, columns: Array) -> Callable[[], Candidate]:
    """Function that gives the candidate of columns (units, n, d) used on every axis."""
    each = columns if problem.lot.radial else np.repeat(columns, problem.per_unit, axis=0)
    return _columns(np.broadcast_to(each, (problem.blocks, problem.n, columns.shape[-1])))


def _columns(columns: Array, *, shared: bool = False) -> Callable[[], Candidate]:
    """Function that gives the candidate of columns (blocks, n, d); they are stored, because every search uses them."""
    candidate = Candidate(columns[:, :, None, :], shared=shared)
    return lambda: candidate


def along_force(problem: Problem, columns: Array) -> Array:
    """Columns (units, n, d) times the force along each axis, g: (blocks, n, d)."""
    wide = own_forces(problem)[..., None] * columns[:, None]
    return wide.reshape(problem.blocks, problem.n, -1)


def _oscillation(problem: Problem, period: float) -> Driver:
    """The driver of an oscillation in time: sine and cosine of a period, s."""
    time = problem.lot.state.time
    phase = 2.0 * np.pi * (time - time.min()) / period
    return Driver("time_s", _on_every_axis(problem, np.stack([np.sin(phase), np.cos(phase)], axis=-1)), period=period)


def _tuned(base: Model, fit: CurveFit) -> CurveFit:
    """An oscillation with its period refined between the values of the grid; any other curve unchanged."""
    if fit.driver.period is None:
        return fit
    duration = float(np.ptp(base.problem.lot.state.time))
    space, cycles = base.at(fit.model.noise), duration / fit.driver.period
    for reach in _BETWEEN:
        near = [_oscillation(base.problem, duration / (cycles + step * reach)) for step in (-2, -1, 0, 1, 2)]
        worth = [float(space.gain(suspect.candidate).drop[0]) for suspect in near]
        cycles += (int(np.argmax(worth)) - 2) * reach
    (tuned,) = fit_curves(base, [_oscillation(base.problem, duration / cycles)])
    tuned = replace(tuned, rank=tuned.rank + 1, cost=tuned.cost + PER_COEFFICIENT)
    return tuned if tuned.cost < fit.cost else fit


def _table(problem: Problem) -> list[Driver]:
    """Drivers of fixture rotations, common to all units, as harmonics of one table angle."""
    state = problem.lot.state
    if state.outer is None or state.inner is None:
        return []
    suspected: list[Driver] = []
    for name, angle in (("outer_deg", state.outer), ("inner_deg", state.inner)):
        if np.ptp(angle) > 0.1:
            turns = [h for k in range(1, _HARMONICS + 1) for h in (np.sin(k * angle), np.cos(k * angle))]
            tilts = [frames.to_fixture(v, state.outer, state.inner) for v in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]
            change = np.stack([t[..., None] * v for t in turns for v in tilts], axis=-1)
            suspected.append(Driver(name, _columns(problem.seen(change), shared=True)))
    return suspected
