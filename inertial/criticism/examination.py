"""Examination of a run: bad dwells and handling errors are removed before effects are judged."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from inertial import effects as catalogue
from inertial.arrays import Array, Places
from inertial.criticism.bad_or_effect import bad_beside_effects, candidates_of
from inertial.criticism.classes import EffectClass, class_of
from inertial.criticism.contradicted_poses import contradiction
from inertial.criticism.drivers import looks_of
from inertial.criticism.field import Candidates
from inertial.criticism.influence import CarriedEvidence, carried_by
from inertial.criticism.left_out import LeftOut, left_out
from inertial.criticism.lot_part import LotPart, part_of
from inertial.criticism.search import SearchResult, convincing, judge, search
from inertial.criticism.unknown import Unexplained
from inertial.data_errors.bad_dwells import any_of_all, bad_dwells
from inertial.data_errors.handling import alternatives
from inertial.data_errors.removed_dwells import BadDwell, without
from inertial.decisions import CLASS_WIDTH, RISES
from inertial.estimation.alternative import Handling, Misfit, soaks
from inertial.estimation.candidate import blocks_of_units
from inertial.estimation.comparison import fitted_residuals, rms, slope_of
from inertial.estimation.force_noise import by_force
from inertial.estimation.loudness import loudness_of
from inertial.estimation.model import Model, refuse_without_freedom
from inertial.estimation.penalty import cost_of_model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import better_placed, replaced, terms_of
from inertial.estimation.term import Term, with_turn_on
from inertial.planning.drivers import drivers_of

_MENDED = 6  # largest number of handling errors reported for one run
_TURNS = 3  # largest number of repeated tests of single dwells, each with a new search
_MOMENTS = 3  # smallest number of dwells at which units change one by one before that is a course of the lot
_CHANGE = {"unit", "dwell"}  # location of a change of one unit


@dataclass(frozen=True)
class Named:
    """A missing class of effects, with the errors, g, before and after it is added to the model.

    heldout_before, heldout_after : g, RMS error on dwells left out, of the worst kind of fold that can judge both; NaN if none
    units, dwells : indices affected by a handling error, no units: all of them; evidence : its description
    carried : the dwells of largest influence; term : the handling error's term, if it stays in the model
    """

    effects: EffectClass
    rms_after: float
    heldout_before: float
    heldout_after: float
    units: tuple[int, ...] = ()
    dwells: tuple[int, ...] = ()
    evidence: str = ""
    carried: CarriedEvidence = field(default_factory=CarriedEvidence)
    term: Term | None = None

    @property
    def predicts(self) -> bool:
        """Whether it predicts dwells left out no worse than without it: only then it is recommended for a model.

        True also where no dwells left out can judge it (NaN), because the likelihood has already named it.
        """
        if np.isnan(self.heldout_before) or np.isnan(self.heldout_after):
            return True
        return bool(self.heldout_after <= (1.0 + RISES) * self.heldout_before)


@dataclass
class ExaminedRun:
    """A lot under examination: the corrections so far, and the terms added to the judged effects.

    beside : terms of handling errors that stay in the model; handled : all handling errors found; removed : bad dwells
    barred : ids of alternatives that only imitate a drift and are not searched again
    drift : the latest drift that such alternatives imitated; if there is one, curves of every kind are suspected
    changing : whether the drift is that of most units, each of which changes at dwells of its own; it ends the search
    contradicted : what is wrong with the poses, if they contradict the outputs; nothing else is then searched
    soak : (n,), index of the soak of each dwell, by the temperatures as measured
    louder : (units, n, axes), white standard deviation of a dwell over its axis', where it depends on the force
    """

    lot: Lot
    effects: tuple[str, ...]
    beside: list[Term] = field(default_factory=list[Term])
    handled: list[Named] = field(default_factory=list[Named])
    removed: list[BadDwell] = field(default_factory=list[BadDwell])
    barred: set[str] = field(default_factory=set[str])
    drift: Unexplained | None = None
    changing: bool = False
    contradicted: str = ""
    soak: Places | None = None
    louder: Array | None = None
    _made: tuple[list[object], Model] | None = None

    def estimate_loudness(self) -> None:
        """Estimate the noise of each soak again, without the errors corrected meanwhile."""
        self.lot = replace(self.lot, loudness=None)
        if self.soak is None:
            self.soak = soaks(self.lot.state)  # stored, so that corrected temperatures do not change the soaks
        loudness = loudness_of(self.model(), self.soak)
        if loudness is not None:
            self.lot = replace(self.lot, loudness=loudness)
        louder = by_force(self.model(), self.soak)
        if louder is not None:
            self.louder = louder if self.louder is None else self.louder * louder
            self.lot = replace(self.lot, error=self.lot.error * louder)

    def was_found(self, term: Term) -> bool:
        """Whether a sudden change of all units by the same effect was found before."""
        return "unit" not in term.keywords and any(
            t.effect.id == term.effect.id and "unit" not in t.keywords for t in self.beside
        )

    def withdraw(self, part: LotPart, further: Sequence[Term]) -> bool:
        """Withdraw sudden changes that together with ``further`` terms are one drift; whether there were any."""
        found = part.drift_of(self.beside, further)
        if found is None:
            return False
        self.drift, imitations = found
        self.barred |= imitations
        self.beside = [t for t in self.beside if t.effect.id not in imitations]
        self.handled = [each for each in self.handled if each.term is None or each.term.effect.id not in imitations]
        return True

    def model(self) -> Model:
        """The judged model in the lot without its bad dwells; the same object as long as lot and terms do not change."""
        parts: list[object] = [self.lot, *self.removed, *self.beside]
        if self._made is None or list(map(id, self._made[0])) != list(map(id, parts)):
            self._made = parts, self._new_model()
        return self._made[1]

    def _new_model(self) -> Model:
        lot = without(self.lot, [d.index for d in self.removed]) if self.removed else self.lot
        problem = Problem(lot)
        base = Model(problem, with_turn_on(lot.state, terms_of(catalogue.get_all(self.effects), problem)))
        refuse_without_freedom(base)
        problem.slope = slope_of(base)
        return base if not self.beside else Model(problem, [*base.terms, *self.beside], near=base.noise)


def examined(
    lot: Lot, effects: Sequence[str], barred: frozenset[str] = frozenset()
) -> "tuple[ExaminedRun, EffectSearch]":
    """A run freed of bad dwells and handling errors, and the search for effects in it; ``barred`` ids are not searched."""
    run = ExaminedRun(lot, tuple(effects), barred=set(barred))
    run.contradicted, run.lot = contradiction(lot)
    if run.contradicted:
        base = run.model()
        fields = Candidates(base.problem, candidates_of(base, run.effects))
        return run, EffectSearch(base, fields, LotPart(fields, base), SearchResult(base, (), ()))
    run.estimate_loudness()
    run.removed = bad_beside_effects(run.model(), run.effects)
    searched = mended(run)
    for _ in range(0 if run.changing else _TURNS):
        # a dwell that deviates in most units was reserved for a wrong pose; if no such error was found, it is bad in each unit
        of_all = not run.handled and not searched.result.added
        if of_all and not any_of_all(run.model()):
            break
        # dwells explained by an effect or a handling error are not bad; with it in the model smaller deviations are visible
        problem = Problem(run.lot, slope=searched.base.problem.slope)
        removed = bad_dwells(replaced(Model(problem, searched.model.terms, near=searched.model.noise)), of_all=of_all)
        same = {d.index for d in removed} == {d.index for d in run.removed}
        if same and not _moved_error(run, searched.model) and not _withdrew_error(run, searched):
            break
        run.removed = removed
        searched = mended(run)
        if run.changing:
            break
    return run, searched


def _withdrew_error(run: ExaminedRun, searched: "EffectSearch") -> bool:
    """Whether a handling error is no longer convincing beside later findings; the first such error is then withdrawn."""
    for named in run.handled if len(run.handled) + len(searched.result.added) > 1 else ():
        if named.term is None:
            continue
        rest = searched.model.without_term(named.term)
        if convincing(searched.field, rest, judge(searched.field, rest, named.term)):
            continue
        run.handled = [other for other in run.handled if other is not named]
        run.beside = [term for term in run.beside if term is not named.term]
        return True
    return False


def _moved_error(run: ExaminedRun, model: Model) -> bool:
    """Whether a change during the run fits better at another dwell, with the bad dwells known; it is then moved there."""
    moved = False
    for at, named in enumerate(run.handled):
        best = None if named.term is None else better_placed(model, named.term)
        if named.term is None or best is None or not isinstance(best.effect, Handling):
            continue
        location = best.location
        size = model.without_term(named.term).with_term(best).shared_sizes(best)
        evidence, dwells = best.effect.describe(run.lot, size, **location), best.effect.dwells(run.lot, **location)
        run.beside = [best if t is named.term else t for t in run.beside]
        run.handled[at] = replace(named, term=best, evidence=evidence, dwells=tuple(dwells))
        moved = True
    return moved


@dataclass(frozen=True)
class EffectSearch:
    """A search for effects that ended without a further handling error; ``part``: the units searched first."""

    base: Model
    field: Candidates
    part: LotPart
    result: SearchResult

    @property
    def model(self) -> Model:
        """The model with all added terms."""
        return self.result.model


def mended(run: ExaminedRun) -> EffectSearch:
    """The search for effects; a handling error that ranks first is recorded and corrected before the next search."""
    while True:
        base = run.model()
        searched_for = [a for a in alternatives() if a.id not in run.barred]
        fields = Candidates(base.problem, candidates_of(base, run.effects), searched_for)
        part = part_of(fields, base, wide=run.drift is not None)
        searched = search(part.field, part.base, part.imitates)
        if part.field is not fields:
            # what a sample takes for a handling error can be an effect in the complete lot
            part.base.problem.forget()
            part.base.forget()
            result = search(fields, base, part.imitates, start=searched.added)
            searched = replace(result, ladder=searched.ladder) if searched.added else result
            base.forget()
        if not searched.handling or len(run.handled) >= _MENDED:
            if run.withdraw(part, searched.added):
                continue
            return EffectSearch(base, fields, part, searched)
        if _of_most_units(fields, searched.model, searched.handling[0]):
            return _changing(run, searched)
        if run.was_found(searched.handling[0]) and run.withdraw(part, searched.handling):
            continue
        for term in searched.handling:
            others = [other for other in searched.handling if other is not term]
            beside = Model(fields.problem, [*searched.model.terms, *others], near=searched.model.noise)
            _mend(run, fields, replace(searched, model=beside if others else searched.model), term)


def _of_most_units(fields: Candidates, model: Model, term: Term) -> bool:
    """Whether most units show a change like that of one unit, at several dwells: it is then no event of that unit."""
    alternative, units = term.effect, fields.problem.lot.state.time.shape[0]
    if not isinstance(alternative, Handling) or units < _MOMENTS or not set(term.keywords) >= _CHANGE:
        return False
    grid, best = fields.grids[alternative.id], dict[float, dict[str, float]]()
    for k in np.argsort(-fields.gain_of(model.space, alternative).drop).tolist():
        best.setdefault(grid[k]["unit"], grid[k])  # units in the order of their largest gain
    most = list(best.values())[: units // 2 + 1]
    several = len({location["dwell"] for location in most}) >= _MOMENTS
    return several and convincing(fields, model, judge(fields, model, Term(alternative, tuple(most[-1].items()))))


def _changing(run: ExaminedRun, searched: SearchResult) -> EffectSearch:
    """The end of a search whose next finding is a change that most units have: each of them has a course over time.

    Changes of single units, bad dwells, and effects of time or temperature are parts of that course and are withdrawn.
    """
    parts = [each.term for each in run.handled if each.term is not None and set(each.term.keywords) >= _CHANGE]
    run.handled = [each for each in run.handled if each.term is None or each.term not in parts]
    run.beside, run.removed = [term for term in run.beside if term not in parts], []
    base, varied = run.model(), {"force", "time", "temperature"}
    fields = Candidates(base.problem, candidates_of(base, run.effects), alternatives())
    physics = [(t, t.effect) for t in searched.added if not isinstance(t.effect, Handling)]
    added = tuple(t for t, effect in physics if drivers_of(run.lot.state, effect) & varied == {"force"})
    time = next(driver for driver in looks_of(base.problem) if driver.name == "time_s")
    curved = base.with_curves(time.candidate.at(0))
    log_p = searched.ladder[0].log_p + float(np.log(fields.looks))
    run.drift, run.changing = Unexplained("time_s", "curve", log_p, floor=curved.floor(), model=curved), True
    model = Model(base.problem, [*base.terms, *added], near=base.noise)
    result = SearchResult(model, added, searched.ladder if added else ())
    return EffectSearch(base, fields, part_of(fields, base, wide=False), result)


def _mend(run: ExaminedRun, fields: Candidates, searched: SearchResult, term: Term) -> None:
    """Correct a handling error of a run, and record it."""
    alternative = term.effect
    if not isinstance(alternative, Handling):
        raise TypeError(term.effect.id)
    location = alternative.placed(run.lot, **term.location)
    term = Term(alternative, tuple(location.items()))
    model = searched.model.with_term(term)
    group = class_of(fields, model, term)
    size = model.shared_sizes(term)
    units = alternative.units(**location)
    evidence, dwells = _described(fields, searched.model, term, alternative, size)
    before, after = left_out(searched.model), left_out(model, term)
    errors = rms(fitted_residuals(model)), *worst(before, after)
    lot = alternative.settled(run.lot, size, _misfit_of(searched.model, model), **location)
    carried, lasting = carried_by(searched.model, term), term if lot is None else None
    run.handled.append(Named(group, *errors, units, dwells, evidence, carried, lasting))
    if lot is None:
        run.beside.append(term)
    else:
        run.lot = lot
    if run.lot.loudness is not None:
        run.estimate_loudness()


def _misfit_of(model: Model, richer: Model) -> Misfit:
    """The misfit of a model as a function of a lot of some units, at the noise of a richer model."""
    local = [t for t in model.terms if not t.shared]

    def left(lot: Lot, units: tuple[int, ...], *, own_noise: bool = False) -> float:
        # dwells that were removed stay removed
        error = model.problem.lot.error[list(units)]
        if own_noise:
            # the loudness of the soaks was estimated before the correction
            return cost_of_model(Model(Problem(replace(lot, error=error, loudness=None)), local))
        problem = Problem(replace(lot, error=error))
        blocks = blocks_of_units(np.array(units), problem.per_unit)
        noise = problem.covariance.rescaled(richer.noise.pick(blocks.tolist()), model.problem.covariance)
        return Model(problem, local).at(noise).rss

    return left


def _described(
    fields: Candidates, beside: Model, term: Term, alternative: Handling, size: Array
) -> tuple[str, tuple[int, ...]]:
    """The description of a handling error and its dwells, including other locations that explain the run equally well."""
    lot, location = fields.problem.lot, term.location
    best = judge(fields, beside, term).cost
    texts: list[str] = []
    dwells = list(alternative.dwells(lot, **location))
    for other in alternative.instead(lot, **location):
        rival = judge(fields, beside, Term(alternative, tuple(other.items())))
        if rival.cost < best + CLASS_WIDTH:
            texts.append(alternative.short(beside.with_term(rival.term).shared_sizes(rival.term), **other))
            dwells += alternative.dwells(lot, **other)
    evidence = alternative.describe(lot, size, **location)
    evidence += f"; these dwells cannot separate it from {' or '.join(texts)}" if texts else ""
    return evidence, tuple(sorted(dwells))


def worst(before: LeftOut, after: LeftOut) -> tuple[float, float]:
    """The worst error on dwells left out, before and after, over the kinds that can judge both."""
    kinds = set(before.density) & set(after.density)
    return before.rms(kinds), after.rms(kinds)
