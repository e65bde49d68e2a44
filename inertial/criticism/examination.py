"""A run under examination: bad dwells and handling errors are removed before effects are judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inertial import effects as catalogue
from inertial.criticism import decisions
from inertial.criticism.bad_dwells import BadDwell, bad_dwells, without
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.decisions import CLASS_WIDTH, RISES
from inertial.criticism.drivers import varies
from inertial.criticism.field import Candidates
from inertial.criticism.freedom import refuse_without_freedom
from inertial.criticism.handling import alternatives
from inertial.criticism.handling.base import Exchangeable, Handling, Misfit, soaks
from inertial.criticism.heldout import fit_rms
from inertial.criticism.influence import CarriedEvidence, carried_by
from inertial.criticism.left_out import LeftOut, left_out
from inertial.criticism.loudness import loudness_of
from inertial.criticism.model import Model
from inertial.criticism.penalty import cost_of_model
from inertial.criticism.problem import Lot, Problem
from inertial.criticism.refinement import replaced, terms_of
from inertial.criticism.search import SearchResult, anything, judge, search
from inertial.criticism.slope import slope_of
from inertial.criticism.term import Term
from inertial.criticism.turn_on import with_turn_on
from inertial.criticism.unknown import Suspect, better_curve, suspects
from inertial.effects.base import AnyEffect
from inertial.effects.covariate import COVARIATE_PREFIX, Covariate

Array = NDArray[np.float64]

_MANY = 32  # largest number of units of a lot that is searched completely
_ENOUGH = 24  # units, distributed over a larger lot, that are searched
_MENDED = 6  # largest number of handling errors reported for one run
_TURNS = 3  # searches after which single dwells are not tested again


@dataclass(frozen=True)
class Named:
    """A class of effects that is missing, with the errors before and after it is added; g.

    heldout_before, heldout_after : on dwells left out, the worst of the kinds that can judge both; NaN if none can
    units, dwells : that an alternative of scope "data" concerns, none for all units; evidence : its description
    carried : the dwells of largest influence
    """

    effects: EffectClass
    rms_after: float
    heldout_before: float
    heldout_after: float
    units: tuple[int, ...] = ()
    dwells: tuple[int, ...] = ()
    evidence: str = ""
    carried: CarriedEvidence = field(default_factory=CarriedEvidence)

    @property
    def predicts(self) -> bool:
        """Whether the prediction of unfitted dwells is no worse with it: only then it is recommended for a model.

        If dwells left out cannot judge it (NaN), it is not recommended.
        """
        return bool(self.heldout_after <= (1.0 + RISES) * self.heldout_before)


@dataclass
class ExaminedRun:
    """A lot under examination: the corrections so far, and the terms that stay in the model beside the judged effects.

    barred : alternatives that only imitate a drift, and are not searched again
    soak : (n,), number of the soak of each dwell, as measured
    """

    lot: Lot
    effects: tuple[str, ...]
    beside: list[Term] = field(default_factory=list[Term])
    handled: list[Named] = field(default_factory=list[Named])
    removed: list[BadDwell] = field(default_factory=list[BadDwell])
    barred: set[str] = field(default_factory=set[str])
    soak: NDArray[np.intp] | None = None
    _made: tuple[list[object], Model] | None = None

    def alternatives(self) -> list[Handling]:
        """Handling errors that are searched."""
        return [a for a in alternatives() if a.id not in self.barred]

    def listen(self) -> None:
        """Estimate the noise of each soak again: an error that was corrected is none of it."""
        self.lot = replace(self.lot, loudness=None)
        if self.soak is None:
            self.soak = soaks(self.lot.state)  # a correction of temperatures changes none of the soaks
        loudness = loudness_of(self.model(), self.soak)
        if loudness is not None:
            self.lot = replace(self.lot, loudness=loudness)

    def model(self) -> Model:
        """The model that is judged, in the lot without its bad dwells; the same object while nothing changes."""
        parts: list[object] = [self.lot, *self.removed, *self.beside]
        if self._made is None or list(map(id, self._made[0])) != list(map(id, parts)):
            self._made = parts, self._new_model()
        return self._made[1]

    def _new_model(self) -> Model:
        lot = without(self.lot, self.removed) if self.removed else self.lot
        problem = Problem(lot)
        base = Model(problem, with_turn_on(lot.state, terms_of(catalogue.get_all(self.effects), problem)))
        refuse_without_freedom(base)
        problem.slope = slope_of(base)
        return base if not self.beside else Model(problem, [*base.terms, *self.beside], near=base.noise)


def examined(lot: Lot, effects: Sequence[str]) -> "tuple[ExaminedRun, EffectSearch]":
    """A run without bad dwells and handling errors, and the search for effects in it."""
    run = ExaminedRun(lot, tuple(effects))
    run.listen()
    run.removed = bad_dwells(run.model())
    searched = mended(run)
    for _ in range(_TURNS):
        if not run.handled and not searched.result.added:
            break
        # dwells that an effect or a handling error explains are not bad; with it in the model smaller ones become visible
        whole = Problem(run.lot, slope=searched.base.problem.slope)
        kept = bad_dwells(replaced(Model(whole, searched.model.terms, near=searched.model.noise)))
        if {(d.unit, d.dwell) for d in kept} == {(d.unit, d.dwell) for d in run.removed}:
            break
        run.removed = kept
        searched = mended(run)
    return run, searched


@dataclass(frozen=True)
class EffectSearch:
    """A search that ended without a further alternative."""

    base: Model
    field: Candidates
    part: "LotPart"
    result: SearchResult

    @property
    def model(self) -> Model:
        """The model with all added terms."""
        return self.result.model


def mended(run: ExaminedRun) -> EffectSearch:
    """The search for effects; a handling error that ranks first is reported and removed before the next search."""
    while True:
        base = run.model()
        fields = Candidates(base.problem, candidates_of(base, run.effects), run.alternatives())
        part = _part(fields, base)
        searched, of = search(part.field, part.base, stop=part.imitates), part.field
        if searched.handling is None and part.field is not fields:
            part.base.problem.forget()
            part.base.forget()
            searched = replace(search(fields, base, stop=part.imitates, start=searched.added), ladder=searched.ladder)
            of = fields
        if part.field is not fields:
            base.forget()
        if searched.handling is None or len(run.handled) >= _MENDED:
            return EffectSearch(base, fields, part, searched)
        if _drifts(run, part, searched.handling):
            continue
        _mend(run, of, searched, searched.handling)


def _drifts(run: ExaminedRun, part: "LotPart", term: Term) -> bool:
    """Whether a sudden change of the whole lot that comes a second time is one drift; then neither change is told any more.

    One step of the reader's reference is an event. Two of them, one after the other, are what a scale factor that changes
    slowly looks like, and a smooth curve of one driver explains it better.
    """
    before = [t for t in run.beside if t.effect.id == term.effect.id and "unit" not in t.keywords]
    if not before or "unit" in term.keywords:
        return False
    keys = {t.key for t in before}
    others = [t for t in part.base.terms if t.key not in keys]
    base = Model(part.field.problem, others, near=part.base.noise)
    if better_curve(base, [*before, term], part.suspected) is None:
        return False
    run.barred.add(term.effect.id)
    run.beside = [t for t in run.beside if t.key not in keys]
    run.handled = [one for one in run.handled if one.effects.members[0].term.effect.id != term.effect.id]
    return True


def _mend(run: ExaminedRun, fields: Candidates, searched: SearchResult, term: Term) -> None:
    """Remove a handling error from a run, and record it."""
    model = searched.model.with_term(term)
    group = class_of(fields, model, term)
    problem = fields.problem
    alternative, place = term.effect, {k: v for k, v in term.keywords.items() if isinstance(v, float)}
    if not isinstance(alternative, Handling):
        raise TypeError(term.effect.id)
    size = model.shared_sizes(term)
    units = (int(place["unit"]),) if "unit" in place else ()
    evidence, dwells = _happened(fields, searched.model, term, alternative, size)
    before, after = left_out(searched.model), left_out(model, term)
    errors = fit_rms(problem, model.terms), *worst(before, after)
    run.handled.append(Named(group, *errors, units, dwells, evidence, carried_by(searched.model, term)))
    lot = alternative.settled(run.lot, size, _misfit(searched.model, model), **place)
    if lot is None:
        run.beside.append(term)
    else:
        run.lot = lot
    if run.lot.loudness is not None:
        run.listen()


def _misfit(model: Model, richer: Model) -> Misfit:
    """Misfit of a model on the dwells of some units, with the noise of a richer model."""
    local = [t for t in model.terms if not t.shared]

    def left(lot: Lot, units: tuple[int, ...]) -> float:
        # dwells that were removed stay removed
        error = model.problem.lot.error[list(units)]
        problem = Problem(replace(lot, error=error))
        blocks = [3 * unit + axis for unit in units for axis in range(3)]
        noise = problem.covariance.rescaled(richer.noise.pick(blocks), model.problem.covariance)
        return Model(problem, local).at(noise).rss

    return left


def _happened(
    fields: Candidates, beside: Model, term: Term, alternative: Handling, size: Array
) -> tuple[str, tuple[int, ...]]:
    """The description of a handling error, and its dwells: at each place that explains the run equally well."""
    lot, place = fields.problem.lot, {k: v for k, v in term.keywords.items() if isinstance(v, float)}
    best = judge(fields, beside, term).cost
    texts: list[str] = []
    dwells = list(alternative.dwells(lot, **place))
    if isinstance(alternative, Exchangeable):
        for other in alternative.instead(lot, **place):
            rival = judge(fields, beside, Term(alternative, tuple(other.items())))
            if rival.cost < best + CLASS_WIDTH:
                texts.append(alternative.short(beside.with_term(rival.term).shared_sizes(rival.term), **other))
                dwells += alternative.dwells(lot, **other)
    evidence = alternative.describe(lot, size, **place)
    evidence += f"; these dwells cannot separate it from {' or '.join(texts)}" if texts else ""
    return evidence, tuple(sorted(dwells))


def candidates_of(base: Model, held: Sequence[str]) -> list[AnyEffect]:
    """Effects and covariates beyond those that a model holds."""
    state = base.problem.lot.state
    effects = [e for e in catalogue.catalogue().values() if e.id not in set(held)]
    names = [name for name, values in state.covariates.items() if varies(values)]
    return [*effects, *(Covariate(name) for name in names if f"{COVARIATE_PREFIX}{name}" not in set(held))]


@dataclass(frozen=True)
class LotPart:
    """The part of a lot that the search for effects needs: effects common to a large lot are visible in two dozen units."""

    field: Candidates
    base: Model

    @cached_property
    def suspected(self) -> list[Suspect]:
        """Curves of every driver."""
        return suspects(self.field.problem)

    def imitates(self, chosen: Sequence[Term]) -> bool:
        """Whether a curve of one driver is better than the chosen effects: by far, or with no further effect left."""
        instead = better_curve(self.base, chosen, self.suspected)
        if instead is None:
            return False
        fit = instead[0]
        problem = self.field.problem
        effects = cost_of_model(Model(problem, [*self.base.terms, *chosen], near=fit.model.noise))
        by_far = effects - fit.cost > decisions.DECISIVE * (cost_of_model(self.base) - fit.cost)
        return by_far or not anything(self.field, fit.model)


def _part(field: Candidates, base: Model) -> LotPart:
    """Some units of a large lot, without those that have a handling error of their own in the model; a small lot as a whole."""
    lot = field.problem.lot
    count = lot.state.time.shape[0]
    if count <= _MANY:
        return LotPart(field, base)
    own = {
        int(np.mean(t.keywords["unit"])) for t in base.terms if isinstance(t.effect, Handling) and "unit" in t.keywords
    }
    sound = [unit for unit in range(count) if unit not in own]
    pick = np.array(sound)[np.linspace(0, len(sound) - 1, min(_ENOUGH, len(sound))).round().astype(int)]
    slope = field.problem.slope
    problem = Problem(lot.units(pick.tolist()), slope=None if slope is None else slope[pick])
    problem.covariance.like(field.problem.covariance)
    terms = [t for t in base.terms if not (isinstance(t.effect, Handling) and "unit" in t.keywords)]
    return LotPart(Candidates(problem, field.effects, [a for a in field.handling if a.in_part]), Model(problem, terms))


def worst(before: LeftOut, after: LeftOut) -> tuple[float, float]:
    """The worst error on dwells left out, before and after, over the kinds that can judge both."""
    kinds = set(before.density) & set(after.density)
    return before.rms(kinds), after.rms(kinds)
