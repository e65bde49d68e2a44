"""The diagnosis of a lot: adequacy, drivers of the residual, classes of missing effects, the unexplained remainder."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator

from inertial import effects as catalogue
from inertial.criticism import decisions
from inertial.criticism.adequacy import adequacy
from inertial.criticism.bad_dwells import BadDwell
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.comparison import estimate, residuals_of
from inertial.criticism.comparison import rms as rms_of
from inertial.criticism.decisions import ADEQUATE_ABOVE, NAMED_BELOW
from inertial.criticism.drivers import Driver, Misfit, drivers_of, places
from inertial.criticism.evidence import GROSS, Evidence, evidence, not_judged
from inertial.criticism.examination import EffectSearch, ExaminedRun, LotPart, Named, examined, worst
from inertial.criticism.field import Candidates
from inertial.criticism.handling.base import Handling
from inertial.criticism.heldout import fit_rms
from inertial.criticism.influence import CarriedEvidence, carried_by, influence
from inertial.criticism.left_out import left_out
from inertial.criticism.likelihood import shared_noise
from inertial.criticism.model import Model, Term
from inertial.criticism.penalty import PER_COEFFICIENT, log_p_value
from inertial.criticism.problem import Lot, Problem
from inertial.criticism.search import Rival, SearchResult
from inertial.criticism.smallest import Smallest, smallest_named
from inertial.criticism.tails import with_tails
from inertial.criticism.unknown import better_curve
from inertial.criticism.unseen import unseen
from inertial.effects.covariate import Covariate
from inertial.planning.ranges import UnseenRange
from inertial.probability import passes


@dataclass(frozen=True)
class Unexplained:
    """A driver that the residuals follow, without an effect of the catalogue that explains it."""

    driver: str
    shape: str
    log_p: float


@dataclass(frozen=True)
class Diagnosis:
    """The diagnosis of a model by a lot; errors in g.

    problem, base, final : the series without handling errors, the judged model, the model with all identified effects
    rms : of the residuals of the base model; floor : of the noise of the measurement, white and wander
    adequate : None if the data cannot decide, for the reason in ``unjudged``
    without_removed : the verdict on the dwells that were not removed; None if there are none, or it cannot be given
    handled : handling errors; removed : single dwells that were left out, those marked that are tails of the noise
    carried : dwells of largest influence: on the first class, or the largest residuals if there is no class
    unseen_in_part : effects that the plan cannot see at some values of their nonlinear parameters, with these
    smallest : the smallest detected size of each effect, those that slow noise hides most first
    """

    problem: Problem
    base: Model
    final: Model
    rms: float
    floor: float
    log_p: float
    adequate: bool | None
    where: tuple[Misfit, ...]
    named: tuple[Named, ...]
    unexplained: Unexplained | None
    unseen: tuple[str, ...]
    ladder: tuple[Rival, ...]
    handled: tuple[Named, ...] = ()
    removed: tuple[BadDwell, ...] = ()
    carried: CarriedEvidence = field(default_factory=CarriedEvidence)
    unseen_in_part: tuple[tuple[str, tuple[UnseenRange, ...]], ...] = ()
    smallest: tuple[Smallest, ...] = ()
    evidence: Evidence | None = None
    unjudged: str = ""
    without_removed: bool | None = None


def diagnose(lot: Lot, effects: Sequence[str], rng: Generator) -> Diagnosis:
    """The diagnosis of a lot against a model.

    Parameters
    ----------
    lot : dwells in g
    effects : ids of the model to judge
    rng : draws the noise that adequacy is measured against
    """
    run, found = examined(lot, effects)
    return _concluded(run, found, rng)


def _concluded(run: ExaminedRun, search_: EffectSearch, rng: Generator) -> Diagnosis:
    """The diagnosis by the result of the search."""
    base, fields, found = search_.base, search_.field, search_.result
    problem = base.problem
    drivers = drivers_of(problem)
    log_p = adequacy(fields, drivers, base, rng)
    removed = tuple(with_tails(found.model, run.removed)) if run.removed else ()
    named_data = bool(run.handled) or any(not d.tail for d in removed)
    rms = _rms(base)
    unjudged = not_judged(base, rms)
    passed = passes(np.exp(log_p), ADEQUATE_ABOVE) if rms <= GROSS else False
    if passed is None and not unjudged:
        unjudged = "the probability of the residuals is undefined; add poses in between"
    if unjudged:
        # data that cannot judge the model cannot identify missing effects either
        found = SearchResult(base, (), found.ladder)
    sound = passed is True and not found.added
    final, unexplained = (found.model, None) if sound or unjudged else _beyond(search_.part, base, found, drivers)
    classes = _classes(fields, base, final)
    named = _named(problem, base, classes)
    if unexplained is None:
        unexplained = _covariate(classes)
    where = places(problem, drivers, base.at(final.noise), final.space.variance)
    charged = tuple(p for p in where if p.log_p + np.log(len(drivers)) < np.log(ADEQUATE_ABOVE))
    every = [*run.handled, *named]
    blind, in_part = unseen(fields, base, [e for e in catalogue.catalogue().values() if e.id not in set(run.effects)])
    return Diagnosis(
        problem=problem,
        base=base,
        final=final,
        rms=rms,
        floor=final.floor(),
        log_p=log_p,
        adequate=_verdict(sound=sound, named_data=named_data, unjudged=unjudged),
        where=() if sound or unjudged else charged,
        named=named,
        unexplained=unexplained,
        unseen=blind,
        unseen_in_part=in_part,
        smallest=tuple(smallest_named(fields, final)),
        ladder=found.ladder,
        handled=tuple(run.handled),
        removed=removed,
        carried=every[0].carried if every else _residuals(base, fields, None if sound or unjudged else rng),
        evidence=evidence(base, fields),
        unjudged=unjudged,
        without_removed=(None if unjudged else sound) if removed else None,
    )


def _residuals(base: Model, fields: Candidates, rng: Generator | None) -> CarriedEvidence:
    """The largest residuals where nothing is named, and the probability of the others; not that without a generator."""
    dwells = influence(base, None)
    if rng is None or not dwells:
        return CarriedEvidence(dwells)
    lot = base.problem.lot
    error = lot.error.copy()
    for one in dwells:
        error[one.unit, one.dwell] = np.inf
    problem = Problem(replace(lot, error=error), slope=base.problem.slope)
    model = Model(problem, base.terms, near=base.noise)
    return CarriedEvidence(dwells, adequacy(Candidates(problem, fields.effects), drivers_of(problem), model, rng))


def _verdict(*, sound: bool, named_data: bool, unjudged: str) -> bool | None:
    """Whether a model is adequate; None if the data cannot decide."""
    if named_data:
        return False
    return None if unjudged else sound


def _rms(base: Model) -> float:
    """Residual of the model that is judged, g: by the published fit if poses are unknown."""
    if base.problem.lot.radial:
        return rms_of(residuals_of(base.problem, estimate(base)))
    return fit_rms(base.problem, base.terms)


def _classes(field: Candidates, base: Model, final: Model) -> list[EffectClass]:
    """A class for every identified effect, the largest first."""
    held = {t.effect.id for t in base.terms}
    model, found = final, []
    for term in [t for t in final.terms if t.effect.id not in held]:
        group = class_of(field, model, term)
        best = next((m.term for m in group.members if not isinstance(m.term.effect, Handling)), term)
        if (
            best is not term
        ):  # a rival that is better beside the others replaces the effect, so that no other class contains it
            others = [t for t in model.terms if t is not term]
            model = Model(base.problem, [*others, best], near=model.noise)
        found.append(group)
    return sorted(found, key=lambda c: -c.size)


def _named(problem: Problem, base: Model, classes: Sequence[EffectClass]) -> tuple[Named, ...]:
    """Errors after each class is added to those before it."""
    found: list[Named] = []
    model = base
    before = left_out(base) if classes else None
    terms = [_first(group) for group in classes]
    for group, first in zip(classes, terms, strict=True):
        model = model.with_term(first)
        after = left_out(model)
        errors = worst(before, after) if before is not None else (float("nan"), float("nan"))
        rest = Model(problem, [*base.terms, *(t for t in terms if t is not first)], near=base.noise)
        left = rms_of(residuals_of(problem, estimate(model))) if problem.lot.radial else fit_rms(problem, model.terms)
        found.append(Named(group, left, *errors, carried=carried_by(rest, first)))
        before = after
    return tuple(found)


def _first(group: EffectClass) -> Term:
    """The best effect of a class, a handling error only if there is no effect."""
    return next((m.term for m in group.members if not isinstance(m.term.effect, Handling)), group.members[0].term)


def _covariate(classes: Sequence[EffectClass]) -> Unexplained | None:
    """A significant dependence on a recorded column of unknown cause."""
    for group in classes:
        best = group.simplest
        if isinstance(best.effect, Covariate):
            return Unexplained(best.effect.column, "line" if best.first == 1 else "curve", group.log_p)
    return None


def _beyond(part: LotPart, base: Model, found: SearchResult, drivers: list[Driver]) -> tuple[Model, Unexplained | None]:
    """The confirmed effects, and the remaining driver: effects that only imitate a curve of one driver are removed."""
    instead = better_curve(part.base, found.added, part.suspected) if found.added else None
    if instead is not None:
        fit, kept = instead
        before = part.base.at(fit.model.noise)
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
    """Whether a driver is significant and large, with the wander estimated beside it: slow drivers and wander look alike."""
    if model.explained(driver.candidate, model.floor()) < decisions.UNEXPLAINED * model.floor():
        return False
    return _driver_log_p(model, driver) + np.log(looks) < np.log(NAMED_BELOW)


def _driver_log_p(model: Model, driver: Driver) -> float:
    """Logarithm of the probability that noise follows a driver as much, with the share of wander estimated beside it."""
    richer = model.with_curves(driver.candidate.columns[:, :, 0, :])
    space = model.at(richer.noise)
    gain = space.gain(driver.candidate)
    return log_p_value(space, float(gain.drop[0]) / shared_noise(model), int(gain.rank[0]))


def _worth(model: Model, driver: Driver) -> float:
    """Reduction of chi-square by a driver, less the price of its coefficients."""
    gain = model.space.gain(driver.candidate)
    return float(gain.drop[0]) / model.space.variance - PER_COEFFICIENT * float(gain.rank[0])
