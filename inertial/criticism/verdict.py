"""The verdict on a model: whether it is adequate, with the RMS of the residuals, the noise floor and the probability."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from inertial import decisions
from inertial import effects as catalogue
from inertial.criticism.adequacy import adequacy
from inertial.criticism.curves import CurveFit
from inertial.criticism.drivers import Driver, looks_of
from inertial.criticism.evidence import GROSS, not_judged
from inertial.criticism.examination import EffectSearch, ExaminedRun, Named, examined
from inertial.criticism.field import Rival
from inertial.criticism.lot_part import LotPart
from inertial.criticism.search import SearchResult, convincing, evident, judge
from inertial.criticism.unknown import Unexplained, better_curve, curve_in_noise, unexplained_by
from inertial.data_errors.removed_dwells import BadDwell
from inertial.data_errors.tails import with_tails
from inertial.decisions import ADEQUATE_ABOVE, CLASS_WIDTH, NAMED_BELOW
from inertial.estimation.alternative import Handling
from inertial.estimation.bases import SEEN
from inertial.estimation.comparison import fitted_residuals
from inertial.estimation.comparison import rms as rms_of
from inertial.estimation.likelihood import shared_noise
from inertial.estimation.model import Model
from inertial.estimation.penalty import PER_COEFFICIENT, log_p_value
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.term import Term
from inertial.planning.drivers import drivers_of
from inertial.probability import passes

_ALMOST_CONSTANT = 10.0 * SEEN
"""Standard deviation of the temperature over the distance of its mean from the reference, below which a run counts as isothermal:
ten times the threshold of visibility of a column."""


@dataclass(frozen=True)
class Verdict:
    """The verdict on a model by a lot, with the examination that it rests on; errors in g.

    run, search, drivers : the examined lot, the search for effects in it, and the tested drivers
    result : outcome of the search; without effects where the data cannot judge the model
    final : the model with all identified effects
    beside : that model with a curve that would otherwise count as noise; drivers are judged at its noise
    unexplained : a driver whose influence no effect explains
    removed : single dwells that were left out; ``tail`` marks those within the tails of the noise
    rms : RMS of the residuals of the judged model; floor : RMS expected from the noise of the measurement, white and wander
    log_p : natural logarithm of the probability that decided: of a test statistic as extreme in an adequate model, or of noise
        that explains as much as what was found
    sound : whether the remaining dwells pass and the search finds nothing
    adequate : None if the data cannot decide, for the reason in ``unjudged``
    """

    run: ExaminedRun
    search: EffectSearch
    drivers: list[Driver]
    result: SearchResult
    final: Model
    beside: Model
    unexplained: Unexplained | None
    removed: tuple[BadDwell, ...]
    rms: float
    floor: float
    log_p: float
    sound: bool
    adequate: bool | None
    unjudged: str = ""

    @property
    def base(self) -> Model:
        """The judged model, in the lot without handling errors and bad dwells."""
        return self.search.base

    @property
    def problem(self) -> Problem:
        """The series of the lot without handling errors and bad dwells."""
        return self.search.base.problem

    @property
    def handled(self) -> tuple[Named, ...]:
        """The handling errors that were found and corrected."""
        return tuple(self.run.handled)

    @property
    def found(self) -> bool:
        """Whether a missing effect, a driver or a data error is found; in noise that happens in at most 0.3 % of lots."""
        spoilt = bool(self.run.handled) or any(not dwell.tail for dwell in self.removed)
        return spoilt or bool(self.result.added) or self.unexplained is not None


def judged(lot: Lot, effects: Sequence[str], rng: Generator) -> Verdict:
    """The verdict of a lot on a model.

    The verdict includes the search for handling errors, which make a passing model not adequate, and for missing effects, without
    which the noise of the measurement cannot be estimated.

    Parameters
    ----------
    lot : dwells in g
    effects : ids of the model to judge
    rng : draws the noise that adequacy is measured against
    """
    verdict = _judged(lot, effects, rng)
    errors = [
        m.term for named in verdict.run.handled for m in named.effects.members if isinstance(m.term.effect, Handling)
    ]
    if not errors or (verdict.unexplained is None and not verdict.result.added):
        return verdict
    # a handling error found before the driver or effect may only have imitated part of it
    without = _judged(lot, effects, rng, frozenset(t.effect.id for t in errors))
    return without if _as_good(without, verdict, errors) else verdict


def _as_good(other: Verdict, verdict: Verdict, errors: Sequence[Term]) -> bool:
    """Whether the same causes explain a lot as well in ``other``, without the named handling ``errors``."""
    if other.handled or _bad(other) > _bad(verdict) or _causes(other) != _causes(verdict):
        return False
    model = _as_found(other, verdict) if other.unexplained is None else other.unexplained.model
    if model is None:
        return False
    field = verdict.search.field
    if model.problem.blocks != field.problem.blocks and any("unit" in t.keywords for t in errors):
        return False  # the curve was fitted to a sample of units, which may not include the unit of the error
    return not any(convincing(field, model, judge(field, model, term)) for term in errors)


def _as_found(other: Verdict, verdict: Verdict) -> Model:
    """The model of ``other`` with the effects at the values of ``verdict``, and with free initial states of their memories.

    The values are not fitted again, because an effect that moves to the dwell of an error, as a step can, replaces the error and
    does not refute it. Devices not at rest leave residuals in the first dwells, which take many coefficients, while a wrong pose
    there takes two.
    """
    added = [replace(t, rest=False) if t.memory else t for t in verdict.result.added]
    return Model(other.problem, [*other.base.terms, *added], near=other.final.noise)


def _bad(verdict: Verdict) -> int:
    """Number of dwells that were left out as bad."""
    return sum(not dwell.tail for dwell in verdict.removed)


def _causes(verdict: Verdict) -> set[str]:
    """The name of the unexplained driver if there is one, else the ids of the added effects."""
    if verdict.unexplained is not None:
        return {verdict.unexplained.driver}
    return {t.effect.id for t in verdict.result.added}


def _judged(lot: Lot, effects: Sequence[str], rng: Generator, barred: frozenset[str] = frozenset()) -> Verdict:
    """The verdict with all handling errors except those of ``barred`` ids as candidates."""
    run, search = examined(_about_its_temperature(lot, effects), effects, barred)
    base, searched = search.base, search.result
    drivers = looks_of(base.problem)
    log_p = -np.inf if run.contradicted else adequacy(search.field, drivers, base, rng)
    removed = tuple(with_tails(searched.model, run.removed)) if run.removed else ()
    named_data = bool(run.handled) or any(not d.tail for d in removed)
    rms = rms_of(fitted_residuals(base))
    unjudged = run.contradicted or not_judged(base, rms)
    passed = passes(np.exp(log_p), ADEQUATE_ABOVE) if rms <= GROSS else False
    if passed is None and not unjudged:
        unjudged = "the probability of the residuals is undefined; add poses in between"
    if unjudged:
        # data that cannot judge the model cannot identify missing effects either
        searched = SearchResult(base, (), searched.ladder)
    if not (unjudged or passed or searched.added):
        searched = _with_a_small_effect(search, base)
    final, unexplained = searched.model, None
    if not unjudged and (searched.added or not passed):
        final, unexplained = _with_curves(search.part, base, searched, drivers)
    # a withdrawn drift counts even if no test of adequacy shows it
    unexplained, beside = unexplained or (None if unjudged else run.drift), final
    if not (unjudged or searched.added or unexplained):
        unexplained, curved = _curve_taken_for_noise(search.part)
        if curved is not None and search.part.field is search.field:
            drivers.append(curved.driver)
            beside = curved.model
    sound = passed is True and not searched.added and unexplained is None and run.drift is None
    gross = rms > GROSS and not (unjudged or named_data or searched.added or unexplained)
    if gross:
        unjudged = (
            f"the residual is larger than the noise of any usable sensor ({GROSS:g} g): the outputs do not follow the recorded "
            "poses; check that they belong together, and the unit of the outputs"
        )
    return Verdict(
        run=run,
        search=search,
        drivers=drivers,
        result=searched,
        final=final,
        beside=beside,
        unexplained=unexplained,
        removed=removed,
        rms=rms,
        floor=_samples(run) or (final.floor() if unexplained is None else min(final.floor(), unexplained.floor)),
        log_p=min(log_p, *_decided(searched, unexplained, search.field.looks)),
        sound=sound,
        adequate=False if named_data or run.contradicted or gross else None if unjudged else sound,
        unjudged=unjudged,
    )


def _samples(run: ExaminedRun) -> float:
    """Noise of the recorded samples, g, where wrong poses leave no estimate from residuals; else zero."""
    known = run.lot.error[np.isfinite(run.lot.error)]
    return rms_of(known) if run.contradicted and run.lot.recorded else 0.0


def _about_its_temperature(lot: Lot, effects: Sequence[str]) -> Lot:
    """An isothermal lot with its mean as the reference temperature of the candidates; any other lot unchanged.

    With a reference of 25 °C the column of a linear coefficient would be constant up to a few per mille and almost invisible
    beside the bias, and its cube, three times as visible, would be named instead. A model with a temperature coefficient keeps
    its reference.
    """
    state = lot.state
    if state.temperature is None:
        return lot
    mean = float(np.mean(state.temperature))
    if float(np.std(state.temperature)) > _ALMOST_CONSTANT * abs(mean - state.reference):
        return lot
    if any("temperature" in drivers_of(state, effect) for effect in catalogue.get_all(effects)):
        return lot
    return replace(lot, state=replace(state, reference=mean, memory={}))


def _decided(searched: SearchResult, unexplained: Unexplained | None, looks: int) -> list[float]:
    """Log probabilities, over all tests, of the first effect and of the unexplained driver, as far as found; after a zero."""
    first = [r.log_p + float(np.log(max(looks, 1))) for r in searched.ladder[:1] if searched.added]
    return [0.0, *first, *([] if unexplained is None else [unexplained.log_p])]


def _with_curves(
    part: LotPart, base: Model, searched: SearchResult, drivers: list[Driver]
) -> tuple[Model, Unexplained | None]:
    """The model with the confirmed effects, without those that imitate a curve; and the unexplained driver or None."""
    suspected = part.suspected(searched.added)
    by_curve = _curve_in_place_of(part, base, searched, suspected)
    if by_curve is not None:
        return by_curve
    final = searched.model
    clear = [d for d in drivers if _convincing(final, d, len(drivers))]
    if not clear:
        return final, None
    if searched.added and len(suspected) < len(part.every_suspect):
        # the residuals still depend on a driver: the effects may be parts of another kind of dependence
        by_curve = _curve_in_place_of(part, base, searched, part.every_suspect)
        if by_curve is not None:
            return by_curve
    best = max(clear, key=lambda d: _worth(final, d))
    columns = best.candidate.at(0)
    curved = final.with_curves(columns)
    log_p = _driver_log_p(final, best) + float(np.log(len(drivers)))
    shape = "line" if columns.shape[-1] == 1 else "curve"
    return final, Unexplained(best.name, shape, log_p, best.part, curved.floor(), curved)


def _with_a_small_effect(search: EffectSearch, base: Model) -> SearchResult:
    """A search that found nothing, with the best evident effect below the smallest size that matters, if there is one.

    In an adequate model, or beside a larger effect, a small effect may result from an inaccurate driver. Where the model is not
    adequate for no other known reason, the small effect is named.
    """
    for rival in search.result.ladder:
        if not isinstance(rival.term.effect, Handling) and evident(search.field, judge(search.field, base, rival.term)):
            return replace(search.result, added=(rival.term,), model=base.with_term(rival.term))
    return search.result


def _curve_taken_for_noise(part: LotPart) -> tuple[Unexplained, CurveFit] | tuple[None, None]:
    """The driver of a curve that the model attributes to noise, and the curve; None, None if there is none."""
    suspected = part.suspected([])
    fit = curve_in_noise(part.base, suspected)
    if fit is None:
        return None, None
    found = unexplained_by(part.base, fit, len(suspected))
    # with few dwells per unit the deviance also falls because a curve takes degrees of freedom
    return (found, fit) if found.log_p < np.log(NAMED_BELOW) else (None, None)


def _curve_in_place_of(
    part: LotPart, base: Model, searched: SearchResult, suspected: Sequence[Driver]
) -> tuple[Model, Unexplained] | None:
    """The model without the effects that imitate a curve, and the curve as an unexplained driver; None if there is none."""
    alike = [] if len(searched.added) != 1 else _as_good_as_the_best(searched.ladder)
    better = better_curve(part.base, searched.added, suspected, alike) if searched.added else None
    if better is None:
        return None
    fit, terms = better
    return Model(base.problem, [*base.terms, *terms]), unexplained_by(part.base, fit, len(suspected))


def _as_good_as_the_best(ladder: Sequence[Rival]) -> list[Term]:
    """The effects of a step of the search that the data do not separate from its best rival."""
    near = [rival.term for rival in ladder if rival.cost < ladder[0].cost + CLASS_WIDTH]
    return [term for term in near if not isinstance(term.effect, Handling)]


def _convincing(model: Model, driver: Driver, looks: int) -> bool:
    """Whether a driver is significant and large, with wander estimated beside it, because slow drivers look like wander."""
    if model.explained(driver.candidate, model.floor()) < decisions.UNEXPLAINED * model.floor():
        return False
    return _driver_log_p(model, driver) + np.log(looks) < np.log(NAMED_BELOW)


def _driver_log_p(model: Model, driver: Driver) -> float:
    """Log probability that noise shows as strong a dependence on a driver, with wander estimated together with it."""
    richer = model.with_curves(driver.candidate.at(0))
    space = model.at(richer.noise)
    gain = space.gain(driver.candidate)
    return log_p_value(space, float(gain.drop[0]) / shared_noise(richer), int(gain.rank[0]))


def _worth(model: Model, driver: Driver) -> float:
    """Reduction of chi-square by a driver, less the price of its coefficients."""
    gain = model.space.gain(driver.candidate)
    return float(gain.drop[0]) / model.space.variance - PER_COEFFICIENT * float(gain.rank[0])
