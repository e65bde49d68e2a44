"""Effects that a plan could not have seen, whole or for a part of the range of their nonlinear parameter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.criticism.covariance import Noise
from inertial.criticism.field import Candidates
from inertial.criticism.model import Model, Term
from inertial.criticism.problem import Problem
from inertial.effects.base import AnyEffect


@dataclass(frozen=True)
class UnseenRange:
    """Values of an effect's nonlinear parameter at which the plan shows nothing of it, in the parameter's unit."""

    effect: str
    parameter: str
    unit: str
    low: float
    high: float


def unseen(field: Candidates, base: Model, candidates: Sequence[AnyEffect]) -> tuple[str, ...]:
    """Effects whose columns the plan leaves empty, makes one with the model's, or does not carry the quantities for."""
    gains = field.gains(base.at(base.problem.covariance.white_noise()), {t.effect.id for t in base.terms})
    blind = [name for name, gain in gains.items() if not gain.rank.any()]
    order = [e.id for e in candidates]
    return tuple(sorted({*blind, *field.lacking} & set(order), key=order.index))


def unseen_ranges(field: Candidates, base: Model, blind: Sequence[str]) -> tuple[UnseenRange, ...]:
    """Effects with a memory that the plan shows for a part of their range only.

    Beside a memory stands its unknown state before the first dwell: a play that is narrower than the steps of soaks that only
    climb is that state and a bias, and nothing else. One unit tells, as the plan is the same for all.
    """
    if base.problem.lot.radial:
        return ()
    held = {t.effect.id for t in base.terms} | set(blind)
    problem = Problem(base.problem.lot.units([0]))
    alone = Model(problem, [t for t in base.terms if not t.shared and "unit" not in t.keywords])
    noise = problem.covariance.white_noise()
    found: list[UnseenRange] = []
    for effect in field.effects:
        parameters = effect.parameters(problem.lot.state)
        if not effect.memory or effect.id in held or len(parameters) != 1 or parameters[0].choices:
            continue
        name, unit = parameters[0].name, parameters[0].unit
        values = [place[name] for place in field.grids[effect.id]]
        shown = np.array([_shown(alone, noise, effect, place) for place in field.grids[effect.id]])
        if shown.any() and not shown.all():
            dark = [v for v, seen in zip(values, shown, strict=True) if not seen]
            found.append(UnseenRange(effect.id, name, unit, float(min(dark)), float(max(dark))))
    return tuple(found)


def _shown(model: Model, noise: Noise, effect: AnyEffect, place: dict[str, float]) -> bool:
    """Whether the first column of an effect shows beside the model and the state that it may have had before."""
    problem = model.problem
    term = Term(effect, tuple(place.items()), 1)
    beside = model.with_curves(problem.start(effect, place))
    return bool(beside.at(noise).gain(term.candidate(problem)).rank[0])
