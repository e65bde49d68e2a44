"""Classes of effects that these data cannot tell apart."""

from dataclasses import dataclass

import numpy as np

from inertial.criticism.model import Model, Term
from inertial.criticism.penalty import cost_in, freedom, log_p_value
from inertial.criticism.refinement import refine
from inertial.criticism.search import Candidates, size_of
from inertial.criticism.shared_noise import shared_factor
from inertial.criticism.space import Space

LEAD = 10.0
"""Penalised chi-square by which the wrong one of two leads with probability Φ(−√10) = 8e-4, where units are independent."""

ROOM = 5.0
"""Chi-square for readings of the drivers that are not exact."""

TOLD_APART = LEAD + ROOM
"""Difference of penalised chi-square that parts two effects; what noise the units share makes of the lead comes on top."""

_NEAR = 80.0
"""Rivals further off on the grid of their nonlinear parameters are not refined."""


@dataclass(frozen=True)
class Member:
    """An effect that explains the data as well as the best of its class; ``score`` in chi-square above the best."""

    term: Term
    score: float


@dataclass(frozen=True)
class EffectClass:
    """Effects not told apart, best first, with what the best of them does.

    log_p : log probability that noise does as much
    size : RMS of the effect beyond what the rest of the model absorbs, g
    """

    members: tuple[Member, ...]
    log_p: float
    size: float

    @property
    def ids(self) -> tuple[str, ...]:
        """Effect ids, best first."""
        return tuple(m.term.effect.id for m in self.members)

    @property
    def simplest(self) -> Term:
        """The member to recommend."""
        return min(self.members, key=lambda m: m.term.effect.simplicity).term


def class_of(field: Candidates, model: Model, term: Term) -> EffectClass:
    """The class of one term of a model, all others held in it."""
    rest = model.without(term.effect.id)
    space = rest.at(model.share)
    variance = model.space.variance
    scored = [(s, t) for s, t in _scores(field, rest, space, variance) if term.effect.id not in t.effect.after]
    own = _score(field, space, variance, term)
    scored.append((own, term))
    best = min(s for s, _ in scored)
    near = [(s, t) for s, t in scored if s < best + _NEAR]
    refined = [(_score(field, space, variance, r), r) for r in (refine(rest, t, model.share) for _, t in near)]
    by_id: dict[str, Member] = {}
    for score, found in sorted([*refined, (own, term)], key=lambda pair: pair[0]):
        by_id.setdefault(found.effect.id, Member(found, score))
    least = min(m.score for m in by_id.values())
    first = min(by_id.values(), key=lambda m: m.score).term
    apart = LEAD * shared_factor(rest.with_term(first), first) + ROOM
    members = [Member(m.term, m.score - least) for m in by_id.values() if m.score < least + apart]
    best_term = members[0].term
    gain = space.gain(best_term.candidate(field.problem))
    log_p = log_p_value(space, float(gain.drop[0]), int(gain.rank[0]))
    return EffectClass(tuple(members), log_p, size_of(rest, best_term))


def _scores(field: Candidates, rest: Model, space: Space, variance: float) -> list[tuple[float, Term]]:
    """Every candidate at its best grid value, whole and by its leading column."""
    leave = {t.effect.id for t in rest.terms}
    found: list[tuple[float, Term]] = []
    for primary, gains in ((False, field.gains(space, leave)), (True, field.primary_gains(space, leave))):
        for effect in field.effects:
            if effect.id not in gains:
                continue
            gain, grid = gains[effect.id], field.grids[effect.id]
            place = int(np.argmax(gain.drop))
            if gain.rank[place]:
                first = effect.primary if primary else None
                term = Term(effect, tuple(grid[place].items()), first)
                found.append((_penalised(field, term, float(gain.drop[place]), int(gain.rank[place]), variance), term))
    return found


def _score(field: Candidates, space: Space, variance: float, term: Term) -> float:
    gain = space.gain(term.candidate(field.problem))
    return _penalised(field, term, float(gain.drop[0]), int(gain.rank[0]), variance)


def _penalised(field: Candidates, term: Term, drop: float, rank: int, variance: float) -> float:
    """Penalised chi-square of a term beside the rest; the noise is the whole model's for every rival."""
    return -drop / variance + cost_in(field.problem, rank, freedom(term))
