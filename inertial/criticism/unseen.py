"""Effects that a plan cannot show, at all or at some values of their nonlinear parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from inertial.arrays import Array
from inertial.criticism.field import Candidates
from inertial.design import grid_of
from inertial.effects.base import AnyEffect, SensorEffect
from inertial.estimation.alternative import soaks
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
from inertial.planning.ranges import UnseenRange, unseen_ranges
from inertial.state import History, State

InPart = tuple[tuple[str, tuple[UnseenRange, ...]], ...]

_SCATTER = 5.0
"""Standard deviations of the thermometer within which a reading is the temperature of its soak."""

_TO_SD = 1.4826
"""Standard deviation of normal values over their median absolute deviation."""


def unseen(field: Candidates, base: Model, candidates: Sequence[AnyEffect]) -> tuple[tuple[str, ...], InPart]:
    """Effects that the plan cannot show, and those that it cannot show at some values, with these.

    An effect is not visible if its columns are zero under the plan or equal to columns of the model, or if its quantities were
    not recorded.
    """
    gains = field.gains([base.at(base.problem.covariance.white_noise())], {t.effect.id for t in base.terms})[0]
    blind = [name for name, gain in gains.items() if not gain.rank.any()]
    order = [e.id for e in candidates]
    state = base.problem.lot.state
    memories = _memories(field, base, {*blind, *(t.effect.id for t in base.terms)})
    ranges = [
        (e.id, unseen_ranges(e, state, memories.get(e.id, (gains[e.id].rank > 0).tolist())))
        for e in candidates
        if e.id in gains
    ]
    return tuple(sorted({*blind, *field.lacking} & set(order), key=order.index)), tuple(r for r in ranges if r[1])


def _memories(field: Candidates, base: Model, without: set[str]) -> Mapping[str, list[bool]]:
    """Whether each effect with a memory is visible, by its place on the grid of its parameter.

    A memory has an unknown state before the first dwell: with rising soaks, a play narrower than their steps is equivalent to
    this state and a bias. One unit is enough, as the plan is the same for all. For a play the scatter of the thermometer is
    removed first: a narrow play would follow it from reading to reading.
    """
    if base.problem.lot.radial:
        return {}
    lot = base.problem.lot.units([0])
    terms = [t for t in base.terms if not t.shared and "unit" not in t.keywords]
    plain, still = (Model(Problem(each), terms) for each in (lot, replace(lot, state=without_scatter(lot.state))))
    visible: dict[str, list[bool]] = {}
    for effect in field.effects:
        continuous = [p for p in effect.parameters(lot.state) if not p.choices]
        if not effect.memory or effect.id in without or len(continuous) != 1:
            continue
        grid = grid_of(effect, lot.state)
        alone = still if _follows_order_only(effect, lot.state, grid[0]) else plain
        noise = alone.problem.covariance.white_noise()
        visible[effect.id] = [_shown(alone, noise, effect, place) for place in grid]
    return visible


def _follows_order_only(effect: AnyEffect, state: State, place: dict[str, float]) -> bool:
    """Whether a memory depends on the order of what it follows and not on time, as a play does and a lag does not."""
    if not isinstance(effect, SensorEffect):
        return False
    once, slower = (
        effect.columns(replace(state, time=factor * state.time, history=None, memory={}), 0, **place)
        for factor in (1.0, 2.0)
    )
    return bool(np.allclose(once, slower))


def without_scatter(state: State) -> State:
    """A state of one unit whose readings are those of their soaks as far as the thermometer's scatter explains the difference."""
    if state.temperature is None:
        return state
    number, read = soaks(state), state.temperature.reshape(-1)
    inside = np.diff(number) == 0
    if np.count_nonzero(inside) < 2:
        return state
    scatter = _TO_SD * float(np.median(np.abs(np.diff(read)[inside]))) / np.sqrt(2.0)
    levels = np.array([np.median(read[number == k]) for k in np.unique(number)])

    def level(values: Array) -> Array:
        nearest = levels[np.argmin(np.abs(values[..., None] - levels), axis=-1)]
        return np.where(np.abs(values - nearest) < _SCATTER * scatter, nearest, values)

    history = state.history
    if history is not None:
        history = History(history.time, level(history.temperature))
    return replace(state, temperature=level(state.temperature), history=history, memory={})


def _shown(model: Model, noise: Noise, effect: AnyEffect, place: dict[str, float]) -> bool:
    """Whether the first column of an effect is visible beside the model and the possible initial state."""
    problem = model.problem
    term = Term(effect, tuple(place.items()), 1)
    # not model.with_curves: the noise of the model itself is not needed
    beside = Model(problem, model.terms, curves=problem.start(effect, place))
    return bool(np.any(beside.at(noise).gain(term.candidate(problem)).rank[0]))
