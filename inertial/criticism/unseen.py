"""Effects that a measurement cannot show, at all or at some parameter values; smallest detectable sizes of the others.

The smallest detectable size is given at the noise of the measurement and without its slow part. The slow part, 1/f noise and
random walk, is estimated from the same dwells and can contain an effect of the same shape. A model that is adequate with such
noise is therefore adequate only with regard to effects larger than these sizes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array, Flags
from inertial.criticism.field import Candidates
from inertial.decisions import MATERIAL, NAMED_BELOW
from inertial.design import at_rest, resting_grid
from inertial.distributions import chi2_upper
from inertial.effects.base import AnyEffect, SensorEffect
from inertial.estimation.alternative import soaks
from inertial.estimation.bases import SEEN
from inertial.estimation.candidate import Candidate
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares
from inertial.estimation.penalty import price
from inertial.estimation.problem import Problem
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.planning.ranges import UnseenRange, unseen_ranges
from inertial.state import History, State

InPart = tuple[tuple[str, tuple[UnseenRange, ...]], ...]

_SCATTER = 5.0
"""Standard deviations of the thermometer within which a reading counts as the temperature of its soak."""


def unseen(field: Candidates, base: Model, candidates: Sequence[AnyEffect]) -> tuple[tuple[str, ...], InPart]:
    """Ids of effects that the plan cannot show, and effects that it cannot show at some parameter values, with these values.

    An effect is not visible if its columns are zero in the plan or linear combinations of columns of the model, or if its
    quantities were not recorded.
    """
    gains = field.gains([base.at(base.problem.covariance.white_noise())], {t.effect.id for t in base.terms})[0]
    blind = [e.id for e in field.effects if e.id in gains and not any(_at_rest(field, e, gains[e.id]))]
    order = [e.id for e in candidates]
    state = base.problem.lot.state
    memories = _memories(field, base, {*blind, *(t.effect.id for t in base.terms)})
    ranges = [
        (e.id, unseen_ranges(e, state, memories.get(e.id) or _at_rest(field, e, gains[e.id])))
        for e in candidates
        if e.id in gains
    ]
    return tuple(sorted({*blind, *field.lacking} & set(order), key=order.index)), tuple(r for r in ranges if r[1])


def _at_rest(field: Candidates, effect: AnyEffect, gain: Gain) -> list[bool]:
    """Whether an effect is visible, for each value of its grid at which the run begins at rest."""
    shown = zip(field.grids[effect.id], gain.rank > 0, strict=True)
    return [bool(there) for values, there in shown if at_rest(effect, values)]


def _memories(field: Candidates, base: Model, without: set[str]) -> Mapping[str, list[bool]]:
    """Visibility of each effect with memory at every grid value of its parameter, by effect id.

    A memory has an unknown initial state: with rising soaks, a backlash narrower than their steps is equivalent to this state and
    a bias. One unit suffices, because the plan is the same for all. For a backlash the scatter of the thermometer is removed
    first, because a narrow backlash would follow it from reading to reading.
    """
    if base.problem.lot.radial:
        return {}
    lot = base.problem.lot.units([0])
    terms = [t for t in base.terms if not t.shared and "unit" not in t.keywords]
    plain, still = (Model(Problem(each), terms) for each in (lot, replace(lot, state=without_scatter(lot.state))))
    visible: dict[str, list[bool]] = {}
    for effect in field.effects:
        continuous = [p for p in effect.parameters(lot.state) if not (p.choices or p.of_run)]
        if not effect.memory or effect.id in without or len(continuous) != 1:
            continue
        grid = resting_grid(effect, lot.state)
        alone = still if _follows_order_only(effect, lot.state, grid[0]) else plain
        noise = alone.problem.covariance.white_noise()
        visible[effect.id] = [_shown(alone, noise, effect, values) for values in grid]
    return visible


def _follows_order_only(effect: AnyEffect, state: State, values: dict[str, float]) -> bool:
    """Whether a memory depends only on the order of its inputs, like a backlash, and not on time, like a lag."""
    if not isinstance(effect, SensorEffect):
        return False
    once, slower = (
        effect.columns(replace(state, time=factor * state.time, history=None, memory={}), 0, **values)
        for factor in (1.0, 2.0)
    )
    return bool(np.allclose(once, slower))


def without_scatter(state: State) -> State:
    """The state of one unit with readings set to the temperature of their soak if thermometer scatter explains the difference."""
    if state.temperature is None:
        return state
    number, read = soaks(state), state.temperature.reshape(-1)
    inside = np.diff(number) == 0
    if np.count_nonzero(inside) < 2:
        return state
    scatter = float(np.median(np.abs(np.diff(read)[inside]))) / (NORMAL_MEDIAN * np.sqrt(2.0))
    levels = np.array([np.median(read[number == k]) for k in np.unique(number)])

    def level(values: Array) -> Array:
        nearest = levels[np.argmin(np.abs(values[..., None] - levels), axis=-1)]
        return np.where(np.abs(values - nearest) < _SCATTER * scatter, nearest, values)

    history = state.history
    if history is not None:
        history = History(history.time, level(history.temperature))
    return replace(state, temperature=level(state.temperature), history=history, memory={})


def _shown(model: Model, noise: Noise, effect: AnyEffect, values: dict[str, float]) -> bool:
    """Whether the first column of an effect is visible beside the model and a free initial state."""
    problem = model.problem
    term = Term(effect, tuple(values.items()), 1)
    # model.with_curves would estimate the noise of the model, which is not needed
    beside = Model(problem, model.terms, curves=problem.start(effect, values))
    return bool(np.any(beside.at(noise).gain(term.candidate(problem)).rank[0]))


_DIGITS = 6
"""Decimals to which ratios of sizes are compared."""


@dataclass(frozen=True)
class Smallest:
    """The smallest detectable size of an effect, g rms over the dwells, with slow noise and without it."""

    effect: str
    size: float
    without_slow: float


def smallest_named(field: Candidates, model: Model) -> list[Smallest]:
    """The smallest detectable sizes of the visible effects, effects hidden most by slow noise first.

    For an effect with nonlinear parameters it is the median over the values at which it is visible.
    """
    noise = model.noise
    spaces = model.at(noise), model.at(Noise(Shares(), noise.scale, noise.prior))
    least = MATERIAL * model.scatter()
    held = {t.effect.id for t in model.terms}
    smallest: list[Smallest] = []
    for effect in (e for e in field.effects if e.id not in held):
        sizes = _sizes(field, model, spaces, effect, least)
        sizes = sizes[:, np.isfinite(sizes).all(axis=0) & (sizes > 0.0).all(axis=0)]
        if sizes.size:
            smallest.append(Smallest(effect.id, *np.median(sizes, axis=1).tolist()))
    # effects that the plan shows equally well keep the order of the catalogue, independent of rounding errors
    return sorted(smallest, key=lambda s: -round(s.size / s.without_slow, _DIGITS))


def _sizes(field: Candidates, model: Model, spaces: tuple[Space, Space], effect: AnyEffect, least: float) -> Array:
    """Smallest RMS, g, of the effect's most visible column that is detected on average, (2, grid): one row per space.

    It is infinite where the effect is not visible; the run is assumed to begin at rest.

    Parameters
    ----------
    spaces : space at the estimated noise, and at its white part alone
    least : g, RMS of an effect's part beyond the model below which it is never reported
    """
    problem, all_values = model.problem, field.grids[effect.id]
    values: list[Array] = []
    for piece in problem.pieces(effect, resting_grid(effect, problem.lot.state)):
        raw = np.sqrt(_squares(piece, problem.covariance.there) / problem.count)
        grid, p = piece.columns.shape[2:]
        coefficients = float(p if piece.shared else problem.blocks * p) + len(all_values[0]) * (len(all_values) > 1)
        needed = _needed(coefficients, field.looks, problem.count)
        each: list[Array] = []
        share = np.ones((grid, p))
        for space in spaces:
            found = space.products(piece)
            seen = np.diagonal(found.left, axis1=-2, axis2=-1).sum(axis=0)
            squares = found.squares.sum(axis=0)
            visible = seen > SEEN**2 * squares
            share = np.where(visible, seen / np.where(visible, squares, 1.0), 0.0)
            with np.errstate(over="ignore"):  # an almost invisible column would need an arbitrary size
                factor = np.sqrt(needed / np.where(visible, seen, 1.0))
            visible &= np.isfinite(factor)
            each.append(np.where(visible, raw * np.where(visible, factor, 0.0), np.inf))
        material = least / np.sqrt(np.where(share > 0.0, share, 1.0))
        values.append(np.stack([np.min(np.maximum(each[0], material), axis=1), np.min(each[1], axis=1)]))
    return np.concatenate(values, axis=1)


def _squares(piece: Candidate, there: Flags) -> Array:
    """Sums of squares (grid, p), g², of columns over the present dwells ``there`` (blocks, n)."""
    each = piece.columns**2
    if piece.rows is None:
        return np.einsum("bngp,bn->gp", each, there.astype(np.float64))
    order = np.argsort(piece.rows, kind="stable")
    first = np.searchsorted(piece.rows[order], np.arange(len(each)))
    count = np.add.reduceat(there[order].astype(np.float64), first, axis=0)
    return np.einsum("bngp,bn->gp", each, count)


def _needed(coefficients: float, looks: int, count: int) -> float:
    """Noncentrality at which an effect with this number of coefficients is detected on average."""
    deviance = max(float(chi2_upper(NAMED_BELOW / max(looks, 1), coefficients)), coefficients)
    while deviance - price(deviance, coefficients) < np.log(max(count, 2)):
        deviance *= 1.02
    return max(deviance - coefficients, 1.0)
