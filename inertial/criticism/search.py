"""The search for missing effects: forward with the noise estimated anew, and back again over what was chosen."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.model import Model, Term
from inertial.criticism.penalty import cost_in, cost_of_model, deviance, freedom, log_p_value
from inertial.criticism.problem import Problem
from inertial.criticism.refinement import refine
from inertial.criticism.space import Candidate, Gain, Space
from inertial.design import grid_of
from inertial.effects.base import AnyEffect
from inertial.errors import MissingInput

Array = NDArray[np.float64]

NAMED_BELOW = 1e-4
"""Probability, over all looks together, below which an effect is named."""

MATERIAL = 0.2
"""Share of the floor below which a significant effect is not named: remainders of imperfect drivers are of that size."""

_FINALISTS = 6  # rivals for which the noise is estimated anew
_AGAIN = 3  # the same where an effect is examined again
_MOST = 6  # effects that one search may add
_SHARES_TRIED = (1.0, 0.15, 0.01)  # of the wander: with the effect inside there is less of it


@dataclass(frozen=True)
class Rival:
    """A candidate effect on its best values, judged beside a model."""

    term: Term
    drop: float
    rank: int
    cost: float
    log_p: float


@dataclass(frozen=True)
class SearchResult:
    """Outcome of the search: the model with what was added, and the rivals of the first step, best first."""

    model: Model
    added: tuple[Term, ...]
    ladder: tuple[Rival, ...]


class Candidates:
    """The candidates of a search, those that these dwells carry the quantities for."""

    def __init__(self, problem: Problem, effects: Iterable[AnyEffect]) -> None:
        self.problem = problem
        self.effects: list[AnyEffect] = []
        self.grids: dict[str, list[dict[str, float]]] = {}
        self.lacking: dict[str, str] = {}
        for effect in effects:
            try:
                grid = grid_of(effect, problem.lot.state)
                problem.columns(effect, grid[0])
            except MissingInput as reason:
                self.lacking[effect.id] = reason.quantity
                continue
            self.effects.append(effect)
            self.grids[effect.id] = grid

    @property
    def looks(self) -> int:
        """Number of tests made in one pass: every effect at every value of its nonlinear parameters."""
        return sum(len(g) for g in self.grids.values())

    def gains(self, space: Space, leave: set[str]) -> dict[str, Gain]:
        """Gain of every candidate that the model does not hold already."""
        found: dict[str, Gain] = {}
        for effect in self.effects:
            if effect.id not in leave:
                found[effect.id] = self._gain(space, effect, None)
        return found

    def _gain(self, space: Space, effect: AnyEffect, first: int | None) -> Gain:
        pieces = self.problem.pieces(effect, self.grids[effect.id], first=first)
        return Gain.joined([space.gain(piece) for piece in pieces])

    def pieces(self) -> Iterator[Candidate]:
        """Every candidate at every value of its nonlinear parameters, in pieces."""
        for effect in self.effects:
            yield from self.problem.pieces(effect, self.grids[effect.id])

    def primary_gains(self, space: Space, leave: set[str]) -> dict[str, Gain]:
        """Gain of the leading column alone, for effects of several columns whose first is an effect of its own."""
        found: dict[str, Gain] = {}
        for effect in self.effects:
            first = effect.primary
            if effect.id not in leave and first is not None:
                found[effect.id] = self._gain(space, effect, first)
        return found


def search(
    field: Candidates, base: Model, stop: Callable[[Sequence[Term]], bool], start: Sequence[Term] = ()
) -> SearchResult:
    """The effects that the measurements call for beyond a base model.

    Parameters
    ----------
    stop : asked before a third and every further effect: whether those chosen only imitate something else
    start : effects that a part of the lot called for already
    """
    chosen: list[Term] = list(start)
    model, ladder = Model(field.problem, [*base.terms, *chosen], near=base.share) if chosen else base, ()
    for _ in range(_MOST - len(chosen)):
        rivals = _contest(field, model)
        ladder = ladder or tuple(rivals)
        best = next((r for r in rivals if convincing(field, model, r)), None)
        if best is None or (len(chosen) >= 2 and stop(chosen)):
            break
        best = _parent_first(field, model, best)
        term = refine(model, best.term, model.with_term(best.term).share)
        chosen.append(term)
        model = model.with_term(term)
        if len(chosen) > 1:
            model, chosen = _reexamine(field, base, model, chosen)
    if len(chosen) > len(start):
        model, chosen = _taken_apart(field, base, model, chosen)
    return SearchResult(model, tuple(chosen), ladder)


def _parent_first(field: Candidates, model: Model, rival: Rival) -> Rival:
    """The lower-order effect that a rival is built on, where it is missing and called for by itself; else the rival."""
    held = {t.effect.id for t in model.terms}
    for effect in field.effects:
        if effect.id in rival.term.effect.after and effect.id not in held:
            parent = judge(field, model, Term(effect, tuple(field.grids[effect.id][0].items())), model.share)
            if convincing(field, model, parent):
                return parent
    return rival


def anything(field: Candidates, model: Model) -> bool:
    """Whether any effect is still called for beyond a model."""
    return any(convincing(field, model, r) for r in _contest(field, model))


def convincing(field: Candidates, model: Model, rival: Rival) -> bool:
    """Whether a rival is significant over all looks, and large enough to matter."""
    if rival.log_p + np.log(max(field.looks, 1)) > np.log(NAMED_BELOW):
        return False
    return size_of(model, rival.term) > MATERIAL * model.with_term(rival.term).floor()


def size_of(model: Model, term: Term) -> float:
    """RMS, g, of what a term explains that the model cannot absorb, less what noise would."""
    return model.explained(term.candidate(model.problem), model.with_term(term).floor())


def _contest(field: Candidates, model: Model, barred: str = "", finalists: int = _FINALISTS) -> list[Rival]:
    """Rivals by their penalised likelihood, the finalists with the noise estimated anew beside them."""
    leave = {*(t.effect.id for t in model.terms), barred}
    tried: dict[str, tuple[float, int, int | None]] = {}
    for factor in _SHARES_TRIED:
        space = model.at(model.share * factor)
        for primary, gains in ((False, field.gains(space, leave)), (True, field.primary_gains(space, leave))):
            for name, gain in gains.items():
                place, score = _best_of(field, space, name, gain)
                if gain.rank[place] and (name not in tried or score < tried[name][0]):
                    effect = next(e for e in field.effects if e.id == name)
                    tried[name] = (score, place, effect.primary if primary else None)
    ranked = sorted(tried, key=lambda k: tried[k][0])[:finalists]
    found = [_exact(field, model, name, tried[name][1], tried[name][2]) for name in ranked]
    return sorted(found, key=lambda r: r.cost)


def _best_of(field: Candidates, space: Space, name: str, gain: Gain) -> tuple[int, float]:
    """Best grid value of a candidate, and its penalised deviance there."""
    place = int(np.argmax(gain.drop))
    nonlinear = len(field.grids[name][0]) if len(field.grids[name]) > 1 else 0
    cost = cost_in(field.problem, int(gain.rank[place]), nonlinear)
    return place, deviance(space, float(gain.drop[place])) + cost


def _exact(field: Candidates, model: Model, name: str, place: int, first: int | None) -> Rival:
    """A finalist with its nonlinear parameters refined and the share of wander estimated with it inside."""
    effect = next(e for e in field.effects if e.id == name)
    term = Term(effect, tuple(field.grids[name][place].items()), first)
    term = refine(model, term, model.with_term(term).share, axes=False)
    richer = model.with_term(term)
    return judge(field, model, term, richer.share)


def judge(field: Candidates, model: Model, term: Term, share: float) -> Rival:
    """A term beside a model at a given share of wander."""
    space = model.at(share)
    gain = space.gain(term.candidate(field.problem))
    drop, rank = float(gain.drop[0]), int(gain.rank[0])
    cost = deviance(space, drop) + cost_in(field.problem, rank, freedom(term))
    return Rival(term, drop, rank, cost, log_p_value(space, drop, rank))


def _reexamine(field: Candidates, base: Model, model: Model, chosen: list[Term]) -> tuple[Model, list[Term]]:
    """Each chosen effect again beside the others: kept, swapped for a better one, or dropped."""
    for term in tuple(chosen):
        if len(chosen) < 2:
            break
        rest = model.without(term.effect.id)
        rivals = _contest(field, rest, finalists=_AGAIN)
        best = next((r for r in rivals if convincing(field, rest, r)), None)
        best = None if best is None else _parent_first(field, rest, best)
        others = [t for t in chosen if t is not term]
        if best is None:
            chosen, model = others, rest
            continue
        chosen = [*others, term if best.term.effect.id == term.effect.id else best.term]
        model = Model(field.problem, [*base.terms, *chosen], near=model.share)
    return model, chosen


def _taken_apart(field: Candidates, base: Model, model: Model, chosen: list[Term]) -> tuple[Model, list[Term]]:
    """Each effect of several columns once more against two simpler ones that together do what it does."""
    for term in tuple(chosen):
        columns = term.candidate(field.problem).columns.shape[-1]
        if columns < 2 or term.effect.scope == "station":
            continue
        others = [t for t in chosen if t is not term]
        pair: list[Term] = []
        rest = Model(field.problem, [*base.terms, *others], near=model.share)
        for _ in range(2):
            rivals = [r for r in _contest(field, rest, barred=term.effect.id) if convincing(field, rest, r)]
            if not rivals:
                break
            pair.append(rivals[0].term)
            rest = rest.with_term(rivals[0].term)
        if len(pair) == 2 and cost_of_model(rest) < cost_of_model(model):
            model, chosen = rest, [*others, *pair]
    return model, chosen
