"""The diagnosis of a lot: adequacy, drivers of the residual, classes of missing effects, the unexplained remainder."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from inertial import effects as catalogue
from inertial.criticism.adequacy import adequacy
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.drivers import Driver, Misfit, looks_of, misfits
from inertial.criticism.evidence import Evidence, evidence
from inertial.criticism.examination import Named, worst
from inertial.criticism.field import Candidates
from inertial.criticism.influence import CarriedEvidence, carried_by, influence
from inertial.criticism.left_out import left_out
from inertial.criticism.unknown import Unexplained
from inertial.criticism.unseen import InPart, Smallest, smallest_named, unseen
from inertial.criticism.verdict import Verdict, judged
from inertial.data_errors.removed_dwells import model_without
from inertial.decisions import ADEQUATE_ABOVE
from inertial.effects.covariate import Covariate
from inertial.estimation.alternative import Handling
from inertial.estimation.comparison import fitted_residuals
from inertial.estimation.comparison import rms as rms_of
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.space import Space


@dataclass(frozen=True)
class Suspected:
    """Effects that explain the residuals better than noise usually does, but not clearly enough to be named.

    effects : ids, best first; log_p : natural logarithm of the probability, over all tests, that noise explains as much
    rms_after : RMS, g, of the residuals with the best of them in the model
    """

    effects: tuple[str, ...]
    log_p: float
    rms_after: float


@dataclass(frozen=True, kw_only=True)
class Diagnosis(Verdict):
    """The verdict on a model by a lot, with what explains it; errors in g.

    where : drivers that the residuals depend on significantly; unseen : ids of effects that the plan cannot show
    named : the classes of missing effects
    without_removed : whether the remaining dwells pass; None if no dwell was removed, or they do not suffice for a verdict
    carried : dwells of largest influence on the first class, or of largest residuals if there is no class
    unseen_in_part : effects that the plan cannot show at some values of their nonlinear parameters, with these values
    smallest : the smallest detectable size of each effect, effects hidden most by slow noise first
    suspected : the most probable missing effects of a model that fails without a named cause, else None
    """

    where: tuple[Misfit, ...]
    named: tuple[Named, ...]
    unseen: tuple[str, ...]
    carried: CarriedEvidence
    unseen_in_part: InPart
    smallest: tuple[Smallest, ...]
    evidence: Evidence
    without_removed: bool | None
    suspected: Suspected | None


def diagnose(lot: Lot, effects: Sequence[str], rng: Generator) -> Diagnosis:
    """The diagnosis of a lot against a model.

    Parameters
    ----------
    lot : dwells in g
    effects : ids of the model to judge
    rng : draws the noise that adequacy is measured against
    """
    verdict = judged(lot, effects, rng)
    drivers, base, final, beside = verdict.drivers, verdict.base, verdict.final, verdict.beside
    fields, problem = verdict.search.field, verdict.problem
    classes = _classes(fields, base, final)
    named = _named(problem, base, classes)
    silent = verdict.sound or bool(verdict.unjudged)
    where = (
        ()
        if silent
        else misfits(
            problem, drivers, base.at(beside.noise), beside.space.variance, _beyond_pose(base, drivers, beside)
        )
    )
    charged = tuple(p for p in where if p.log_p + np.log(len(drivers)) < np.log(ADEQUATE_ABOVE))
    every = [*verdict.handled, *named]
    others = [e for e in catalogue.catalogue().values() if e.id not in set(verdict.run.effects)]
    blind, in_part = unseen(fields, base, others)
    return Diagnosis(
        **vars(replace(verdict, unexplained=verdict.unexplained or _covariate(classes))),
        where=charged,
        named=named,
        unseen=blind,
        unseen_in_part=in_part,
        smallest=tuple(smallest_named(fields, final)),
        carried=every[0].carried if every else _residuals(base, fields, None if silent else rng),
        evidence=evidence(base, fields),
        without_removed=(None if verdict.unjudged else verdict.sound) if verdict.removed else None,
        suspected=None if verdict.found or verdict.adequate is not False else _suspected(verdict),
    )


def _suspected(verdict: Verdict) -> Suspected | None:
    """The effects of the first search step that noise seldom explains; None if a handling error is among them."""
    enough = np.log(ADEQUATE_ABOVE / max(verdict.search.field.looks, 1))
    seldom = [rival for rival in verdict.result.ladder if rival.log_p < enough]
    if not seldom or any(isinstance(rival.term.effect, Handling) for rival in seldom):
        return None
    left = rms_of(fitted_residuals(verdict.base.with_term(seldom[0].term)))
    over_all = seldom[0].log_p - float(enough) + float(np.log(ADEQUATE_ABOVE))
    return Suspected(tuple(rival.term.effect.id for rival in seldom), over_all, left)


def _beyond_pose(base: Model, drivers: Sequence[Driver], final: Model) -> Space:
    """The residuals of a model after any dependence on the pose, at the noise of the final model."""
    pose = next((driver for driver in drivers if driver.name == "pose"), None)
    if pose is None:
        return base.at(final.noise)
    return base.with_curves(pose.candidate.at(0)).at(final.noise)


def _residuals(base: Model, fields: Candidates, rng: Generator | None) -> CarriedEvidence:
    """The largest residuals where nothing is named, and, given a generator, the probability of the remaining dwells."""
    dwells = influence(base, None)
    if rng is None or not dwells:
        return CarriedEvidence(dwells)
    model = model_without(base, [(d.unit, d.dwell) for d in dwells])
    problem = model.problem
    return CarriedEvidence(dwells, adequacy(Candidates(problem, fields.effects), looks_of(problem), model, rng))


def _classes(field: Candidates, base: Model, final: Model) -> list[EffectClass]:
    """The class of every identified effect, the largest effect first."""
    held = {t.effect.id for t in base.terms}
    model, classes = final, []
    for term in [t for t in final.terms if t.effect.id not in held]:
        group = class_of(field, model, term)
        best = group.physics[0].term if group.physics else term
        if best is not term:
            # a rival that is better beside the others replaces the effect, so that no other class contains it
            others = [t for t in model.terms if t is not term]
            model = Model(base.problem, [*others, best], near=model.noise)
        classes.append(group)
    return sorted(classes, key=lambda c: -c.size)


def _named(problem: Problem, base: Model, classes: Sequence[EffectClass]) -> tuple[Named, ...]:
    """The classes with the errors before and after each is added, in order, to the model with the classes before it.

    Where a class does not reduce the error on dwells left out, the comparison is repeated beside all other classes: a second
    effect as large as the first can mask what the first predicts. Then it is repeated at one noise, that of the richer model: a
    walk estimated without the effect can follow it from dwell to dwell, but predicts no other run.
    """
    named: list[Named] = []
    model = base
    # an error of handling if there is no effect
    terms = [(group.physics or group.members)[0].term for group in classes]
    before = left_out(base, also=terms) if classes else None
    for group, first in zip(classes, terms, strict=True):
        poorer, model = model, model.with_term(first)
        after = left_out(model, also=terms)
        errors = worst(before, after) if before is not None else (float("nan"), float("nan"))
        rest = Model(problem, [*base.terms, *(t for t in terms if t is not first)], near=base.noise)
        left = rms_of(fitted_residuals(model))
        found = Named(group, left, *errors, carried=carried_by(rest, first))
        if not found.predicts and len(classes) > 1:
            errors = worst(left_out(rest, also=terms), left_out(rest.with_term(first), also=terms))
            found = replace(found, heldout_before=errors[0], heldout_after=errors[1])
        if not found.predicts:
            errors = worst(left_out(poorer.held_at(model.noise.shares), also=terms), after)
            found = replace(found, heldout_before=errors[0], heldout_after=errors[1])
        named.append(found)
        before = after
    return tuple(named)


def _covariate(classes: Sequence[EffectClass]) -> Unexplained | None:
    """A significant dependence on a recorded column of unknown cause."""
    for group in classes:
        best = group.proposed
        if isinstance(best.effect, Covariate):
            return Unexplained(best.effect.column, "line" if best.first == 1 else "curve", group.log_p)
    return None
