"""The diagnosis of a lot: adequacy, where the model fails, classes of missing effects, what is left unexplained."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.random import Generator

from inertial import effects as catalogue
from inertial.criticism.adequacy import adequacy
from inertial.criticism.bad_dwells import BadDwell, bad_dwells, heavy_tails, without
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.decisions import ADEQUATE_ABOVE, NAMED_BELOW, RISES
from inertial.criticism.drivers import Driver, Place, drivers_of, places
from inertial.criticism.field import Field
from inertial.criticism.handling import alternatives
from inertial.criticism.handling.base import Handling
from inertial.criticism.heldout import fit_rms
from inertial.criticism.influence import Influence, influence, log_p_without
from inertial.criticism.left_out import LeftOut, left_out
from inertial.criticism.likelihood import shared_noise
from inertial.criticism.model import Model, Term, refuse_without_freedom
from inertial.criticism.penalty import PER_COEFFICIENT, cost_of_model, log_p_value
from inertial.criticism.problem import Lot, Problem
from inertial.criticism.refinement import terms_of
from inertial.criticism.search import Found, Rival, anything, search
from inertial.criticism.slope import slope_of
from inertial.criticism.turn_on import with_turn_on
from inertial.criticism.unknown import Suspect, better_curve, suspects
from inertial.effects.base import AnyEffect
from inertial.effects.covariate import COVARIATE_PREFIX, Covariate

_MANY = 32  # units of a lot that is searched whole
_ENOUGH = 24  # units, spread over the lot, that a larger one is searched in
_MENDED = 6  # alternatives that are told of one run at the most

DECISIVE = 0.2
"""Share of what a curve brings by which it must beat the effects chosen so far to end the search for more."""

UNEXPLAINED = 0.5
"""Share of the floor below which a smooth dependence is left alone."""


@dataclass(frozen=True)
class Named:
    """A class of effects that is missing, with the errors before and after it is added; g.

    heldout_before, heldout_after : on dwells left out, the worst of the kinds that can judge both; NaN where none can
    units, dwells : that an alternative of scope "data" concerns, none for all units; told : what it did, in words
    """

    effects: EffectClass
    rms_after: float
    heldout_before: float
    heldout_after: float
    units: tuple[int, ...] = ()
    dwells: tuple[int, ...] = ()
    told: str = ""

    @property
    def predicts(self) -> bool:
        """Whether what was not fitted is predicted no worse with it: nothing else is worth to be added to a model."""
        return not self.heldout_after > (1.0 + RISES) * self.heldout_before


@dataclass(frozen=True)
class Unexplained:
    """A driver that the residuals follow without an effect of the catalogue that would explain it."""

    driver: str
    shape: str
    log_p: float


@dataclass(frozen=True)
class Diagnosis:
    """What a lot says of a model; errors in g.

    problem, base, final : the series without what handling spoilt, the model judged, the model with everything that was found
    rms : of the base model's residuals; floor : of the noise that is there
    handled : what handling did; removed : single dwells that were left out; heavy : whether these are tails of the noise
    influence : dwells that carry the verdict; log_p_without : of its first class when these are left out
    """

    problem: Problem
    base: Model
    final: Model
    rms: float
    floor: float
    log_p: float
    adequate: bool
    where: tuple[Place, ...]
    named: tuple[Named, ...]
    unexplained: Unexplained | None
    unseen: tuple[str, ...]
    ladder: tuple[Rival, ...]
    handled: tuple[Named, ...] = ()
    removed: tuple[BadDwell, ...] = ()
    heavy: bool = False
    influence: tuple[Influence, ...] = ()
    log_p_without: float | None = None


@dataclass
class _Run:
    """A lot under examination: what was mended so far, and what stays in the model beside the effects that are judged."""

    lot: Lot
    effects: tuple[str, ...]
    beside: list[Term] = field(default_factory=list[Term])
    handled: list[Named] = field(default_factory=list[Named])
    removed: list[BadDwell] = field(default_factory=list[BadDwell])

    def model(self) -> Model:
        """The model that is judged, in the lot without its bad dwells."""
        lot = without(self.lot, self.removed) if self.removed else self.lot
        problem = Problem(lot)
        base = Model(problem, with_turn_on(lot.state, terms_of(catalogue.get_all(self.effects), problem)))
        refuse_without_freedom(base)
        problem.slope = slope_of(base)
        return base if not self.beside else Model(problem, [*base.terms, *self.beside], near=base.noise)


def diagnose(lot: Lot, effects: Sequence[str], rng: Generator) -> Diagnosis:
    """The diagnosis of a lot against a model.

    Parameters
    ----------
    lot : dwells in g
    effects : ids of the model to judge
    rng : draws the noise that adequacy is measured against
    """
    run = _Run(lot, tuple(effects))
    run.removed = bad_dwells(run.model())
    found = _mended(run)
    if run.removed and found.found.added:
        # what physics explains is no bad dwell
        whole = Problem(run.lot, slope=found.base.problem.slope)
        kept = bad_dwells(Model(whole, found.model.terms, near=found.model.noise))
        if {(d.unit, d.dwell) for d in kept} != {(d.unit, d.dwell) for d in run.removed}:
            run.removed = kept
            found = _mended(run)
    return _told(run, found, rng)


@dataclass(frozen=True)
class _Search:
    """A search that ended without a further alternative."""

    base: Model
    field: Field
    part: "_Part"
    found: Found

    @property
    def model(self) -> Model:
        """With everything that was added."""
        return self.found.model


def _mended(run: _Run) -> _Search:
    """The search for effects, each alternative that comes first told and taken out of the lot before it begins again."""
    while True:
        base = run.model()
        fields = Field(base.problem, _candidates(base, run.effects), alternatives())
        part = _part(fields, base)
        found = search(part.field, part.base, stop=part.imitates)
        if found.handling is None and part.field is not fields:
            found = replace(search(fields, base, stop=part.imitates, start=found.added), ladder=found.ladder)
        if found.handling is None or len(run.handled) >= _MENDED:
            return _Search(base, fields, part, found)
        _mend(run, part.field, found, found.handling)


def _mend(run: _Run, fields: Field, found: Found, term: Term) -> None:
    """Take what handling did out of a run, and note it."""
    model = found.model.with_term(term)
    group = class_of(fields, model, term)
    problem = fields.problem
    alternative, place = term.effect, {k: v for k, v in term.keywords.items() if isinstance(v, float)}
    if not isinstance(alternative, Handling):
        raise TypeError(term.effect.id)
    size = model.shared_sizes(term)
    units = (int(place["unit"]),) if "unit" in place else ()
    told = alternative.told(problem.lot, size, **place)
    dwells = tuple(alternative.dwells(problem.lot, **place))
    before, after = left_out(found.model), left_out(model)
    errors = fit_rms(problem, model.terms), *_worst(before, after)
    run.handled.append(Named(group, *errors, units, dwells, told))
    lot = alternative.mended(run.lot, size, **place)
    if lot is None:
        run.beside.append(term)
    else:
        run.lot = lot


def _candidates(base: Model, held: Sequence[str]) -> list[AnyEffect]:
    state = base.problem.lot.state
    effects = [e for e in catalogue.catalogue().values() if e.id not in set(held)]
    return [*effects, *(Covariate(name) for name in state.covariates if f"{COVARIATE_PREFIX}{name}" not in set(held))]


def _told(run: _Run, search_: _Search, rng: Generator) -> Diagnosis:
    """The diagnosis of what was searched."""
    base, fields, found = search_.base, search_.field, search_.found
    problem = base.problem
    drivers = drivers_of(problem)
    log_p = adequacy(fields, drivers, base, rng)
    heavy = bool(run.removed) and heavy_tails(base)
    named_data = bool(run.handled) or (bool(run.removed) and not heavy)
    sound = log_p >= np.log(ADEQUATE_ABOVE) and not found.added
    final, unexplained = (found.model, None) if sound else _beyond(search_.part, base, found, drivers)
    classes = _classes(fields, base, final)
    named = _named(problem, base, classes)
    if unexplained is None:
        unexplained = _covariate(classes)
    where = places(problem, drivers, base.at(final.noise), final.space.variance)
    charged = tuple(p for p in where if p.log_p + np.log(len(drivers)) < np.log(ADEQUATE_ABOVE))
    carried, log_without = _influence(base, named)
    return Diagnosis(
        problem=problem,
        base=base,
        final=final,
        rms=fit_rms(problem, base.terms),
        floor=final.floor(),
        log_p=log_p,
        adequate=sound and not named_data,
        where=() if sound else charged,
        named=named,
        unexplained=unexplained,
        unseen=_unseen(fields, base, [e for e in catalogue.catalogue().values() if e.id not in set(run.effects)]),
        ladder=found.ladder,
        handled=tuple(run.handled),
        removed=tuple(run.removed),
        heavy=heavy,
        influence=carried,
        log_p_without=log_without,
    )


def _influence(base: Model, named: Sequence[Named]) -> tuple[tuple[Influence, ...], float | None]:
    """Dwells that carry the verdict on the largest class beside the others, and its probability without them."""
    if not named:
        return influence(base, None), None
    terms = [n.effects.members[0].term for n in named]
    rest = Model(base.problem, [*base.terms, *terms[1:]], near=base.noise)
    carried = influence(rest, terms[0])
    return carried, log_p_without(rest, terms[0], carried) if carried else None


@dataclass(frozen=True)
class _Part:
    """As much of a lot as the search for effects needs: what all units of a large lot share shows in two dozen of them."""

    field: Field
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
        effects = cost_of_model(Model(problem, [*self.base.terms, *chosen], near=fit.model.noise))
        by_far = effects - fit.cost > DECISIVE * (cost_of_model(self.base) - fit.cost)
        return by_far or not anything(self.field, fit.model)


def _part(field: Field, base: Model) -> _Part:
    lot = field.problem.lot
    if lot.state.time.shape[0] <= _MANY:
        return _Part(field, base)
    pick = np.linspace(0, lot.state.time.shape[0] - 1, _ENOUGH).round().astype(int)
    slope = field.problem.slope
    problem = Problem(lot.units(pick.tolist()), slope=None if slope is None else slope[pick])
    terms = [t for t in base.terms if not isinstance(t.effect, Handling)]
    return _Part(Field(problem, field.effects, [a for a in field.handling if a.fewest_units > 1]), Model(problem, terms))


def _unseen(field: Field, base: Model, candidates: Sequence[AnyEffect]) -> tuple[str, ...]:
    """Effects whose columns the plan leaves empty, makes one with the model's, or does not carry the quantities for."""
    gains = field.gains(base.at(base.problem.covariance.white_noise()), {t.effect.id for t in base.terms})
    blind = [name for name, gain in gains.items() if not gain.rank.any()]
    order = [e.id for e in candidates]
    return tuple(sorted({*blind, *field.lacking} & set(order), key=order.index))


def _classes(field: Field, base: Model, final: Model) -> list[EffectClass]:
    """A class for every effect that was found, the largest first."""
    held = {t.effect.id for t in base.terms}
    model, found = final, []
    for term in [t for t in final.terms if t.effect.id not in held]:
        group = class_of(field, model, term)
        best = next((m.term for m in group.members if not isinstance(m.term.effect, Handling)), term)
        if (
            best is not term
        ):  # a rival that is better beside the others takes the place, so that no other class has it too
            others = [t for t in model.terms if t is not term]
            model = Model(base.problem, [*others, best], near=model.noise)
        found.append(group)
    return sorted(found, key=lambda c: -c.size)


def _named(problem: Problem, base: Model, classes: Sequence[EffectClass]) -> tuple[Named, ...]:
    """Errors after each class is added to those before it."""
    found: list[Named] = []
    model = base
    before = left_out(base) if classes else None
    for group in classes:
        first = next((m.term for m in group.members if not isinstance(m.term.effect, Handling)), group.members[0].term)
        model = model.with_term(first)
        after = left_out(model)
        worst = _worst(before, after) if before is not None else (float("nan"), float("nan"))
        found.append(Named(group, fit_rms(problem, model.terms), *worst))
        before = after
    return tuple(found)


def _worst(before: LeftOut, after: LeftOut) -> tuple[float, float]:
    """The worst error on dwells left out, before and after, over the kinds that can judge both."""
    kinds = set(before.density) & set(after.density)
    return before.rms(kinds), after.rms(kinds)


def _covariate(classes: Sequence[EffectClass]) -> Unexplained | None:
    """A dependence on a recorded column without physics behind it: real, and its cause unknown."""
    for group in classes:
        best = group.simplest
        if isinstance(best.effect, Covariate):
            return Unexplained(best.effect.column, "line" if best.first == 1 else "curve", group.log_p)
    return None


def _beyond(part: "_Part", base: Model, found: Found, drivers: list[Driver]) -> tuple[Model, Unexplained | None]:
    """The effects that stand, and the driver that is left: effects that only imitate a curve of one driver are taken back."""
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
    """Whether a driver is significant and large, the wander estimated with it inside: slow drivers and wander look alike."""
    if model.explained(driver.candidate, model.floor()) < UNEXPLAINED * model.floor():
        return False
    return _driver_log_p(model, driver) + np.log(looks) < np.log(NAMED_BELOW)


def _driver_log_p(model: Model, driver: Driver) -> float:
    """Logarithm of the probability that noise follows a driver as much, the share of wander estimated with it inside."""
    richer = model.with_curves(driver.candidate.columns[:, :, 0, :])
    space = model.at(richer.noise)
    gain = space.gain(driver.candidate)
    return log_p_value(space, float(gain.drop[0]) / shared_noise(model), int(gain.rank[0]))


def _worth(model: Model, driver: Driver) -> float:
    """What a driver takes off, in chi-square, less the price of its coefficients."""
    gain = model.space.gain(driver.candidate)
    return float(gain.drop[0]) / model.space.variance - PER_COEFFICIENT * float(gain.rank[0])
