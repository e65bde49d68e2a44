"""The search for missing effects: forward selection with the noise estimated again, then backward over the chosen effects."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial import decisions
from inertial.criticism.field import Candidates, Rival
from inertial.criticism.jumps import jumps_in_place_of, jumps_in_place_of_wander
from inertial.decisions import CERTAIN_BELOW, CLASS_WIDTH, JUMPS_RARE, MATERIAL, NAMED_BELOW, REMAINDER
from inertial.estimation.alternative import Handling, OfOneDwell
from inertial.estimation.candidate import Candidate
from inertial.estimation.likelihood import common_at, likelihood_ratio, weighed
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise
from inertial.estimation.penalty import cost_of_model, fall
from inertial.estimation.refinement import refine
from inertial.estimation.space import Gain, Space
from inertial.estimation.term import Term
from inertial.probability import log_chi2_tail

_FINALISTS = 5  # finalists at each noise, for which the noise is estimated again
_AGAIN = 3  # finalists at each noise when a chosen effect is examined again
_TOGETHER = 2  # largest number of effects that are added to the best one when jumps explain more than it alone
_MOST = 6  # largest number of effects of one search
_AS_MUCH = 1.0  # score by which all columns of an effect must be better than its leading columns alone
_INEXACT = 0.01  # share of a wrong angle that differs between devices, by their scale factors and misalignments
_REFINED, _UNCHANGED = 3, 0.05  # largest number of refinements; relative change of a parameter that ends them
_GAINED = 3.0  # largest factor on a log probability that refinement gains


@dataclass(frozen=True)
class SearchResult:
    """Outcome of the search.

    model : with the added effects; added : their terms; ladder : the rivals of the first step, best first
    handling : handling errors that were best in the last step and ended the search; they are not in ``model``
    """

    model: Model
    added: tuple[Term, ...]
    ladder: tuple[Rival, ...]
    handling: tuple[Term, ...] = ()


def search(
    field: Candidates,
    base: Model,
    stop: Callable[[Sequence[Term]], bool],
    start: Sequence[Term] = (),
) -> SearchResult:
    """The effects that the measurements require beyond a base model, or the handling error that must be corrected first.

    Parameters
    ----------
    stop : called from the third effect on: whether the chosen effects only imitate another cause
    start : effects already found in a sample of the lot's units
    """
    chosen: list[Term] = list(start)
    model, ladder = Model(field.problem, [*base.terms, *chosen], near=base.noise) if chosen else base, ()
    best: Rival | None = None
    for _ in range(_MOST - len(chosen)):
        rivals = contest(field, model)
        ladder = ladder or tuple(rivals)
        best = next((r for r in rivals if convincing(field, model, r) and not is_remainder(model, r, chosen)), None)
        if best is None or (len(chosen) >= 2 and stop(chosen)):
            break
        if isinstance(best.term.effect, Handling):
            return SearchResult(model, tuple(chosen), ladder, (best.term,))
        added, jumps = _added_or_jumps(field, model, best, rivals)
        if jumps:
            return SearchResult(model, tuple(chosen), ladder, jumps)
        widened = _with_complete_form(field, model, added[0], chosen) if len(added) == 1 else None
        if widened is not None:
            chosen = widened
            model = Model(field.problem, [*base.terms, *chosen], near=model.noise)
            continue
        for rival in added:
            chosen.append(rival.term)
            model = model.with_term(rival.term)
        if len(chosen) > 1:
            model, chosen, handled = _reexamine(field, base, model, chosen)
            if handled is not None:
                return SearchResult(model, tuple(chosen), ladder, (handled,))
    if len(chosen) > len(start):
        model, chosen = _replaced_by_two(field, base, model, chosen)
    return SearchResult(model, tuple(chosen), ladder, jumps_in_place_of_wander(field, model) if best is None else ())


def _added_or_jumps(
    field: Candidates, model: Model, best: Rival, rivals: Sequence[Rival]
) -> tuple[list[Rival], tuple[Term, ...]]:
    """The effects that are added for the best rival, or the jumps of single axes that explain more."""
    jumps = jumps_in_place_of(field, model, best)
    if jumps is None or jumps.ahead <= 0.0:
        return [_parent_first(field, model, best)], ()
    several = _several_effects(field, model, rivals)
    return several, () if several else jumps.terms


def _several_effects(field: Candidates, model: Model, rivals: Sequence[Rival]) -> list[Rival]:
    """Two or three effects that together explain more than jumps of single axes; none if there are no such effects.

    Jumps of an axis may imitate several effects at once, such as a bias that follows a polynomial of the temperature.
    """
    sets = [[rival] for rival in rivals if rival.rank and not isinstance(rival.term.effect, Handling)][:_FINALISTS]
    for _ in range(_TOGETHER):
        larger = [[*effects, further] for effects in sets for further in _another(field, model, effects)]
        sets = sorted(larger, key=lambda effects: sum(rival.cost for rival in effects))[:1]
        jumps = jumps_in_place_of(field, model, *sets[0]) if sets else None
        if sets and (jumps is None or jumps.ahead <= 0.0):
            return sets[0]
    return []


def _another(field: Candidates, model: Model, effects: Sequence[Rival]) -> list[Rival]:
    """The best further effect with coefficients for every axis; none if it is not convincing, or an effect is shared."""
    beside = Model(field.problem, [*model.terms, *(rival.term for rival in effects)], near=model.noise)
    rivals = contest(field, beside, finalists=_AGAIN)
    physics = [r for r in rivals if not isinstance(r.term.effect, Handling) and convincing(field, beside, r)]
    return [] if any(r.term.shared for r in (*effects, *physics[:1])) else physics[:1]


def _parent_first(field: Candidates, model: Model, rival: Rival) -> Rival:
    """The lower-order effect that a rival presupposes, if it is missing and significant alone; else the rival."""
    held = {t.effect.id for t in model.terms}
    for effect in field.effects:
        if effect.id in rival.term.effect.after and effect.id not in held:
            parent = judge(field, model, Term(effect, tuple(field.grids[effect.id][0].items())))
            if convincing(field, model, parent):
                return parent
    return rival


def _with_complete_form(field: Candidates, model: Model, rival: Rival, chosen: Sequence[Term]) -> list[Term] | None:
    """The chosen effects with one in its complete form, if that explains as much as adding the rival; else None.

    The simpler form of an effect with memory leaves a residual, which would be found as another effect.
    """
    simpler = [term for term in chosen if term.memory and term.first is not None]
    if not simpler:
        return None
    least = cost_of_model(model.with_term(rival.term))
    found: list[Term] | None = None
    for term in simpler:
        wider = judge_refined(field, model.without_term(term), replace(term, first=None)).term
        terms = [wider if each is term else each for each in chosen]
        cost = cost_of_model(model.without_term(term).with_term(wider))
        if cost <= least:
            found, least = terms, cost
    return found


def anything(field: Candidates, model: Model) -> bool:
    """Whether a model requires a further effect."""
    return any(convincing(field, model, r) for r in contest(field, model, finalists=_AGAIN))


def convincing(field: Candidates, model: Model, rival: Rival) -> bool:
    """Whether a rival is significant over all tests, exceeds its price, and is large enough to matter."""
    return (
        evident(field, rival)
        and size_where_it_acts(model, rival.term) > MATERIAL * model.with_term(rival.term).scatter()
    )


def evident(field: Candidates, rival: Rival) -> bool:
    """Whether a rival is significant over all tests and exceeds its price, however small it is."""
    effect = rival.term.effect
    rare = JUMPS_RARE if isinstance(effect, Handling) and effect.of_one_axis else 0.0
    if rival.log_p + 0.5 * rare + np.log(max(field.looks, 1)) > np.log(NAMED_BELOW):
        return False
    return -rival.cost - rare >= float(np.log(max(field.problem.count, 1)))


def size_of(model: Model, term: Term) -> float:
    """RMS, g, over all dwells, of the part of a term beyond the model, less that expected from noise."""
    return model.explained(term.candidate(model.problem), model.with_term(term).scatter())


def is_remainder(model: Model, rival: Rival, chosen: Sequence[Term]) -> bool:
    """Whether a handling error explains no more than residuals left by chosen effects of inexact shape.

    Effects without nonlinear parameter and memory have exactly the shape of their equation and leave no such residuals.
    """
    inexact = [t for t in chosen if not isinstance(t.effect, Handling) and (t.effect.memory or t.effect.nonlinear)]
    if not inexact or not isinstance(rival.term.effect, Handling):
        return False
    largest = max(size_of(model.without_term(t), t) for t in inexact)
    return size_where_it_acts(model, rival.term) < REMAINDER * largest


def size_where_it_acts(model: Model, term: Term) -> float:
    """RMS, g, of a term; of a handling error only over the dwells that it changes, not diluted by the others."""
    size = size_of(model, term)
    if not isinstance(term.effect, Handling):
        return size
    problem = model.problem
    changed = np.any(term.columns(problem) != 0.0, axis=-1) & problem.covariance.there
    return size * float(np.sqrt(problem.count / max(int(changed.sum()), 1)))


def contest(field: Candidates, model: Model, barred: str = "", finalists: int = _FINALISTS) -> list[Rival]:
    """Rivals, best first: the best candidates at the model's noise, at less wander and at none, each then at its own noise."""
    leave = {*(t.effect.id for t in model.terms if not isinstance(t.effect, Handling)), barred}
    chosen: dict[str, Term] = {}
    noise = model.noise
    less = noise.shares.times(decisions.LESS_FLICKER, decisions.LESS_WALK)
    others = [noise] if less == noise.shares else [noise, model.noise_at(less)]
    if noise.shares.walk:
        # in a few dwells a random walk can absorb a drift completely: without any wander the drift is visible
        others.append(model.noise_at(noise.shares.times(0.0, 0.0)))
    for looked in scanned(field, [model.at(other) for other in others], leave):
        for term, _ in looked[:finalists]:
            chosen.setdefault(term.effect.id, term)
    return ranked([_judged_if_hopeful(field, model, term) for term in chosen.values()])


def _judged_if_hopeful(field: Candidates, model: Model, term: Term) -> Rival:
    """A term added to a model, with nonlinear parameters refined if that can make it significant.

    In lots with hidden effects refinement multiplied the log probability by at most 2.6 (for converter steps), else by 1.04.
    Refining candidates that noise explains would take a third of the time of a large lot.
    """
    first = judge(field, model, term)
    hopeless = _GAINED * first.log_p + np.log(max(field.looks, 1)) > np.log(NAMED_BELOW)
    return first if hopeless else judge_refined(field, model, term)


def scanned(field: Candidates, spaces: Sequence[Space], leave: set[str]) -> list[list[tuple[Term, float]]]:
    """For each space the candidates at their best grid values with scores, best first; without those below their price."""
    complete, leading = field.gains(spaces, leave, handling=True), field.gains(spaces, leave, primary=True)
    return [_best_first(field, *each) for each in zip(spaces, complete, leading, strict=True)]


def _best_first(
    field: Candidates, space: Space, complete: dict[str, Gain], leading: dict[str, Gain]
) -> list[tuple[Term, float]]:
    """The candidates at one noise, from their gains and those of their leading columns."""
    tried: dict[str, tuple[float, Term]] = {}
    for primary, gains in ((False, complete), (True, leading)):
        for name, gain in gains.items():
            score, point = _best_of(field, space, name, gain)
            # fewer columns that explain as much are preferred
            least = tried[name][0] - _AS_MUCH if name in tried else 0.0
            if score > max(least, 0.0):
                effect = field.of(name)
                values = tuple(field.grids[name][point].items())
                tried[name] = (score, Term(effect, values, effect.primary if primary else None))
    return [(term, score) for score, term in sorted(tried.values(), key=lambda pair: -pair[0])]


def _best_of(field: Candidates, space: Space, name: str, gain: Gain) -> tuple[float, int]:
    """Best score of a candidate at a noise, and its index on the grid; zero if noise alone explains it."""
    falls = fall(space, gain)
    several = len(field.grids[name]) > 1 and field.looks_of(name) == 1
    nonlinear = len(field.grids[name][0]) if several else 0
    best = 0.0, int(np.argmax(falls))
    # the values that explain most in all units together are others where each unit shows little
    for point in {best[1], int(np.argmax(gain.common))} if gain.by_block.size else {best[1]}:
        if gain.rank[point]:
            part = common_at(space, gain, point)
            ratio = weighed(float(falls[point]), int(gain.rank[point]), nonlinear, field.looks_of(name), part)
            likely = ratio.log_p + np.log(max(field.looks, 1)) > np.log(NAMED_BELOW)
            if ratio.score > best[0] and not likely:
                best = ratio.score, point
    return best


def judge_refined(field: Candidates, model: Model, term: Term, noise: Noise | None = None) -> Rival:
    """A term added to a model, with refined nonlinear parameters and the better treatment of its initial state.

    Parameters
    ----------
    noise : noise for the refinement; None: that of the model with the term, estimated again while a parameter moves
    """
    if isinstance(term.effect, Handling):
        return judge(field, model, refine(model, term, noise or model.with_term(term).noise))
    return min((_refined(field, model, begun, noise) for begun in _initial_states(model, term)), key=lambda r: r.cost)


def _refined(field: Candidates, model: Model, term: Term, noise: Noise | None) -> Rival:
    for _ in range(_REFINED if noise is None and term.effect.nonlinear else 1):
        before = term
        term = refine(model, term, noise or model.with_term(term).noise)
        old, new = (np.ravel(np.array([np.mean(v) for v in t.keywords.values()])) for t in (before, term))
        if not np.any(np.abs(new - old) > _UNCHANGED * np.abs(old) + 1e-12):
            break  # if a parameter moves, part of the effect had counted as noise, and the noise changes
    return _judged(field, model, term)


def judge(field: Candidates, model: Model, term: Term) -> Rival:
    """A term added to a model, with the noise estimated again; without gain for an impossible handling error."""
    if isinstance(term.effect, Handling):
        # its size must be possible, and an error of a single dwell must explain all of that dwell
        possible = term.effect.possible(model.with_term(term).shared_sizes(term))
        if not possible or (isinstance(term.effect, OfOneDwell) and not _only_tilted(model, term)):
            return Rival(term, 0.0, 0, 0.0, 0.0)
    return min((_judged(field, model, each) for each in _initial_states(model, term)), key=lambda r: r.cost)


def _only_tilted(model: Model, term: Term) -> bool:
    """Whether an error that all units share explains a dwell up to noise and the second-order terms of two angles.

    A supply drop, or a bias of the complete lot that is high in one dwell, changes each unit and axis by a different amount. Part
    of that resembles two angle errors; the residual shows that it is none. The unit with the largest residual is not counted,
    because its dwell may be bad for another reason.
    """
    richer = model.with_term(term)
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < 3 or problem.lot.radial:
        return True
    here = np.arange(problem.n) == int(float(np.mean(term.keywords["at"])))
    column = np.broadcast_to(here.astype(np.float64)[None, :, None, None], (problem.blocks, problem.n, 1, 1))
    gain = richer.space.gain(Candidate(column, shared=False))
    of_units = gain.by_block[:, 0].reshape(units, problem.per_unit).sum(axis=1)
    # bound of the residuals of true angle errors: second order, and scale factors and misalignments of each device
    angle = float(np.linalg.norm(richer.shared_sizes(term)))
    by_tilt = float(model.at(richer.noise).gain(term.candidate(problem)).drop[0])
    second = (2.0 * (0.5 * angle + _INEXACT)) ** 2 * by_tilt
    left = float(of_units.sum() - of_units.max()) - second
    # the threshold of adequacy under heavy tails, for the best of all dwells
    return left <= 0.0 or float(log_chi2_tail(left, problem.per_unit * (units - 1.0))) > np.log(
        CERTAIN_BELOW**2 / problem.n
    )


def _judged(field: Candidates, model: Model, term: Term) -> Rival:
    return Rival.of(term, likelihood_ratio(model, term, field.looks_of(term.effect.id)))


def _initial_states(model: Model, term: Term) -> tuple[Term, ...]:
    """A term and, if it has a memory, also the term without coefficients for its initial state in each series.

    The initial state is then at rest, or as a parameter of the effect says. Devices are usually at rest when a run begins. With a
    coefficient per series for the initial state, its price would favour an effect without memory that fits as well, such as a
    step between two soaks instead of hysteresis.
    """
    if not term.memory:
        return (term,)
    term = replace(term, rest=False)
    if not term.start(model.problem).shape[-1]:
        return (term,)
    return term, replace(term, rest=True)


def ranked(rivals: Sequence[Rival]) -> list[Rival]:
    """Rivals, best first, all judged at the φ and also at the wander of the best of them, which is best there, too.

    Two effects that are identical in the poses of a plan have equal residuals, but φ, estimated from quantiles, changes
    their deviances by a few per cent: each judged at its own φ, they could fall into different classes.
    """
    ordered = sorted(rivals, key=lambda r: r.cost)
    for _ in rivals:
        before, best = ordered[0].term, ordered[0].ratio
        if best is not None:
            ordered = sorted((r.at(best) for r in ordered), key=lambda r: r.cost)
        if ordered[0].term is before:
            break
    return ordered


def _reexamine(
    field: Candidates, base: Model, model: Model, chosen: list[Term]
) -> tuple[Model, list[Term], Term | None]:
    """The model and the chosen effects after each is judged again beside the others: unchanged, replaced, or removed.

    The third result is a handling error that is better than the class of an effect and replaces it, else None.
    """
    for term in tuple(chosen):
        if len(chosen) < 2:
            break
        rest, others = model.without(term.effect.id), [t for t in chosen if t is not term]
        every = contest(field, rest, finalists=_AGAIN)
        rivals = [r for r in every if not isinstance(r.term.effect, Handling)]
        ahead = min((r.cost for r in rivals), default=0.0) - CLASS_WIDTH
        handled = next(
            (r for r in every[:1] if r.cost < ahead and r not in rivals and convincing(field, rest, r)), None
        )
        if handled is not None:
            return rest, others, handled.term
        best = next((r for r in rivals if convincing(field, rest, r)), None)
        if best is None:
            chosen, model = others, rest
            continue
        best = _parent_first(field, rest, best)
        chosen = [*others, term if best.term.effect.id == term.effect.id else best.term]
        model = Model(field.problem, [*base.terms, *chosen], near=model.noise)
    return model, chosen, None


def _replaced_by_two(field: Candidates, base: Model, model: Model, chosen: list[Term]) -> tuple[Model, list[Term]]:
    """The model and the chosen effects, with effects of several columns replaced where two simpler ones cost less."""
    for term in tuple(chosen):
        columns = term.candidate(field.problem).columns.shape[-1]
        if columns < 2 or term.shared:
            continue
        others = [t for t in chosen if t is not term]
        pair: list[Term] = []
        rest = Model(field.problem, [*base.terms, *others], near=model.noise)
        for _ in range(2):
            every = contest(field, rest, barred=term.effect.id, finalists=_AGAIN)
            rivals = [r for r in every if not isinstance(r.term.effect, Handling) and convincing(field, rest, r)]
            if not rivals:
                break
            pair.append(rivals[0].term)
            rest = rest.with_term(rivals[0].term)
        if len(pair) == 2 and cost_of_model(rest) < cost_of_model(model):
            model, chosen = rest, [*others, *pair]
    return model, chosen
