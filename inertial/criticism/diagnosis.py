"""The diagnosis of a lot: adequacy, where the model fails, classes of missing effects, what is left unexplained."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.random import Generator

from inertial import effects as catalogue
from inertial.criticism.adequacy import adequacy
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.drivers import Driver, Misfit, drivers_of, places, varies
from inertial.criticism.heldout import fit_rms, heldout_rms
from inertial.criticism.model import Model, Term, refuse_without_freedom
from inertial.criticism.penalty import PER_COEFFICIENT, cost_of_model, log_p_value
from inertial.criticism.problem import Lot, Problem
from inertial.criticism.refinement import terms_of
from inertial.criticism.search import (
    NAMED_BELOW,
    Candidates,
    Rival,
    SearchResult,
    anything,
    search,
)
from inertial.criticism.turn_on import with_turn_on
from inertial.criticism.unknown import Suspect, better_curve, suspects
from inertial.effects.base import AnyEffect
from inertial.effects.covariate import COVARIATE_PREFIX, Covariate

STEEPER = 0.0
"""Penalised chi-square by which a random walk beside the 1/f wander must beat the effects found without it."""

_MANY = 32  # units of a lot that is searched whole
_ENOUGH = 24  # units, spread over the lot, that a larger one is searched in

DECISIVE = 0.2
"""Share of what a curve brings by which it must beat the effects chosen so far to end the search for more."""

UNEXPLAINED = 0.5
"""Share of the floor below which a smooth dependence is left alone."""

ADEQUATE_ABOVE = 0.05
"""Probability above which a model passes: the nominal rate of false alarms."""


@dataclass(frozen=True)
class Named:
    """A class of effects that is missing, with the errors before and after it is added; g."""

    effects: EffectClass
    rms_after: float
    heldout_after: float


@dataclass(frozen=True)
class Unexplained:
    """A driver that the residuals follow without an effect of the catalogue that would explain it."""

    driver: str
    shape: str
    log_p: float


@dataclass(frozen=True)
class Diagnosis:
    """What a lot says of a model; errors in g.

    problem, base, final : the series, the model judged, the model with everything that was found
    rms : of the base model's residuals; floor : of the noise that is there; share : of wander in it, ρ
    """

    problem: Problem
    base: Model
    final: Model
    rms: float
    floor: float
    log_p: float
    adequate: bool
    where: tuple[Misfit, ...]
    named: tuple[Named, ...]
    unexplained: Unexplained | None
    unseen: tuple[str, ...]
    ladder: tuple[Rival, ...]


def diagnose(lot: Lot, effects: Sequence[str], rng: Generator) -> Diagnosis:
    """The diagnosis of a lot against a model.

    Parameters
    ----------
    lot : dwells in g
    effects : ids of the model to judge
    rng : draws the noise that adequacy is measured against
    """
    found = _examined(Problem(lot), effects, rng)
    if found.adequate or (found.unexplained is not None and _covariate([n.effects for n in found.named]) is None):
        return found
    # what looks like drift, ageing and steps may be a wander steeper than 1/f: it is believed where it does better without them
    steep = Problem(lot, steep=True)
    bare = min(cost_of_model(Model(steep, m.terms)) for m in (found.base, found.final))
    if bare > cost_of_model(found.final) - STEEPER:
        return found
    return _examined(steep, effects, rng)


def _examined(problem: Problem, effects: Sequence[str], rng: Generator) -> Diagnosis:
    """The diagnosis under one kind of wander."""
    lot = problem.lot
    held = catalogue.get_all(effects)
    base = Model(problem, with_turn_on(lot.state, terms_of(held, problem)))
    refuse_without_freedom(base)
    candidates = [e for e in catalogue.catalogue().values() if e.id not in set(effects)]
    covariates = [
        Covariate(name)
        for name, values in lot.state.covariates.items()
        if varies(values) and f"{COVARIATE_PREFIX}{name}" not in set(effects)
    ]
    field = Candidates(problem, [*candidates, *covariates])
    drivers = drivers_of(problem)
    unseen = _unseen(field, base, candidates)
    log_p = adequacy(field, drivers, base.space, rng)
    part = _part(field, base)
    found = search(part.field, part.base, stop=part.imitates)
    if part.field is not field:
        found = replace(search(field, base, stop=part.imitates, start=found.added), ladder=found.ladder)
    adequate = log_p >= np.log(ADEQUATE_ABOVE) and not found.added
    final, unexplained = (found.model, None) if adequate else _beyond(part, base, found, drivers)
    classes = _classes(field, base, final)
    named = _named(problem, base, classes)
    if unexplained is None:
        unexplained = _covariate(classes)
    floor = final.floor()
    where = places(problem, drivers, base.at(final.share), final.space.variance)
    charged = tuple(p for p in where if p.log_p + np.log(len(drivers)) < np.log(ADEQUATE_ABOVE))
    return Diagnosis(
        problem=problem,
        base=base,
        final=final,
        rms=fit_rms(problem, base.terms),
        floor=floor,
        log_p=log_p,
        adequate=adequate,
        where=() if adequate else charged,
        named=named,
        unexplained=unexplained,
        unseen=unseen,
        ladder=found.ladder,
    )


@dataclass(frozen=True)
class _Part:
    """As much of a lot as the search for effects needs: what all units of a large lot share shows in two dozen of them."""

    field: Candidates
    base: Model

    @cached_property
    def suspected(self) -> list[Suspect]:
        """Curves of every driver."""
        return suspects(self.field.problem)

    def imitates(self, chosen: Sequence[Term]) -> bool:
        """Whether a curve of one driver does better than the effects chosen: by far, or leaving nothing else to find."""
        instead = better_curve(self.base, chosen, self.suspected)
        if instead is None:
            return False
        fit = instead[0]
        problem = self.field.problem
        effects = cost_of_model(Model(problem, [*self.base.terms, *chosen], near=fit.model.share))
        by_far = effects - fit.cost > DECISIVE * (cost_of_model(self.base) - fit.cost)
        return by_far or not anything(self.field, fit.model)


def _part(field: Candidates, base: Model) -> _Part:
    lot = field.problem.lot
    if lot.state.time.shape[0] <= _MANY:
        return _Part(field, base)
    pick = np.linspace(0, lot.state.time.shape[0] - 1, _ENOUGH).round().astype(int)
    problem = Problem(lot.units(pick.tolist()), steep=field.problem.steep)
    return _Part(Candidates(problem, field.effects), Model(problem, base.terms))


def _unseen(field: Candidates, base: Model, candidates: Sequence[AnyEffect]) -> tuple[str, ...]:
    """Effects whose columns the plan leaves empty, makes one with the model's, or does not carry the quantities for."""
    gains = field.gains(base.at(0.0), {t.effect.id for t in base.terms})
    blind = [name for name, gain in gains.items() if not gain.rank.any()]
    order = [e.id for e in candidates]
    return tuple(sorted({*blind, *field.lacking} & set(order), key=order.index))


def _classes(field: Candidates, base: Model, final: Model) -> list[EffectClass]:
    """A class for every effect that was found, the largest first."""
    held = {t.effect.id for t in base.terms}
    model, found = final, []
    for term in [t for t in final.terms if t.effect.id not in held]:
        group = class_of(field, model, term)
        best = group.members[0].term
        if (
            best is not term
        ):  # a rival that is better beside the others takes the place, so that no other class has it too
            others = [t for t in model.terms if t is not term]
            model = Model(base.problem, [*others, best], near=model.share)
        found.append(group)
    return sorted(found, key=lambda c: -c.size)


def _named(problem: Problem, base: Model, classes: Sequence[EffectClass]) -> tuple[Named, ...]:
    """Errors after each class is added to those before it."""
    terms, found = list(base.terms), []
    for group in classes:
        terms.append(group.members[0].term)
        found.append(Named(group, fit_rms(problem, terms), heldout_rms(problem, terms)))
    return tuple(found)


def _covariate(classes: Sequence[EffectClass]) -> Unexplained | None:
    """A dependence on a recorded column without physics behind it: real, and its cause unknown."""
    for group in classes:
        best = group.simplest
        if isinstance(best.effect, Covariate):
            return Unexplained(best.effect.column, "line" if best.first == 1 else "curve", group.log_p)
    return None


def _beyond(part: "_Part", base: Model, found: SearchResult, drivers: list[Driver]) -> tuple[Model, Unexplained | None]:
    """The effects that stand, and the driver that is left: effects that only imitate a curve of one driver are taken back."""
    instead = better_curve(part.base, found.added, part.suspected) if found.added else None
    if instead is not None:
        fit, kept = instead
        before = part.base.at(fit.model.share)
        drop = max(before.rss - fit.model.space.rss, 0.0)
        log_p = log_p_value(before, drop, fit.rank) + float(np.log(len(part.suspected)))
        return Model(base.problem, [*base.terms, *kept]), Unexplained(fit.driver, "curve", log_p)
    final = found.model
    convincing = [d for d in drivers if _convincing(final, d, len(drivers))]
    if not convincing:
        return final, None
    best = max(convincing, key=lambda d: _worth(final, d))
    shape = "line" if best.candidate.columns.shape[-1] == 1 else "curve"
    return final, Unexplained(best.name, shape, _driver_log_p(final, best) + float(np.log(len(drivers))))


def _convincing(model: Model, driver: Driver, looks: int) -> bool:
    """Whether a driver is significant and large, the wander estimated with it inside: slow drivers and wander look alike."""
    if model.explained(driver.candidate, model.floor()) < UNEXPLAINED * model.floor():
        return False
    return _driver_log_p(model, driver) + np.log(looks) < np.log(NAMED_BELOW)


def _driver_log_p(model: Model, driver: Driver) -> float:
    """Logarithm of the probability that noise follows a driver as much, the share of wander estimated with it inside."""
    richer = model.with_curves(driver.candidate.columns[:, :, 0, :])
    space = model.at(richer.share)
    gain = space.gain(driver.candidate)
    return log_p_value(space, float(gain.drop[0]), int(gain.rank[0]))


def _worth(model: Model, driver: Driver) -> float:
    """What a driver takes off, in chi-square, less the price of its coefficients."""
    gain = model.space.gain(driver.candidate)
    return float(gain.drop[0]) / model.space.variance - PER_COEFFICIENT * float(gain.rank[0])
