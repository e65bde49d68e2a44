"""Effects that a plan cannot show, at all or at some values of their nonlinear parameters."""

from collections.abc import Mapping, Sequence

import numpy as np

from inertial.criticism.covariance import Noise
from inertial.criticism.field import Candidates
from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Problem
from inertial.design import grid_of
from inertial.effects.base import AnyEffect
from inertial.planning.ranges import UnseenRange, unseen_ranges

InPart = tuple[tuple[str, tuple[UnseenRange, ...]], ...]


def unseen(field: Candidates, base: Model, candidates: Sequence[AnyEffect]) -> tuple[tuple[str, ...], InPart]:
    """Effects that the plan cannot show, and those that it cannot show at some values, with these.

    An effect is not visible if its columns are zero under the plan or equal to columns of the model, or if its quantities were
    not recorded.
    """
    gains = field.gains(base.at(base.problem.covariance.white_noise()), {t.effect.id for t in base.terms})
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
    this state and a bias. One unit is enough, as the plan is the same for all.
    """
    if base.problem.lot.radial:
        return {}
    problem = Problem(base.problem.lot.units([0]))
    alone = Model(problem, [t for t in base.terms if not t.shared and "unit" not in t.keywords])
    noise = problem.covariance.white_noise()
    visible: dict[str, list[bool]] = {}
    for effect in field.effects:
        parameters = effect.parameters(problem.lot.state)
        if not effect.memory or effect.id in without or len(parameters) != 1 or parameters[0].choices:
            continue
        visible[effect.id] = [_shown(alone, noise, effect, place) for place in grid_of(effect, problem.lot.state)]
    return visible


def _shown(model: Model, noise: Noise, effect: AnyEffect, place: dict[str, float]) -> bool:
    """Whether the first column of an effect is visible beside the model and the possible initial state."""
    problem = model.problem
    term = Term(effect, tuple(place.items()), 1)
    beside = model.with_curves(problem.start(effect, place))
    return bool(np.any(beside.at(noise).gain(term.candidate(problem)).rank[0]))
