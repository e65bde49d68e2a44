"""Classes of effects that the data cannot separate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from inertial import decisions
from inertial.criticism.field import Candidates, Rival
from inertial.criticism.jumps import Jumps, jumps_in_place_of
from inertial.criticism.search import judge, judge_refined, ranked, scanned, size_of
from inertial.decisions import CLASS_WIDTH, CLEAR_LEAD
from inertial.estimation.alternative import Handling
from inertial.estimation.candidate import Candidate
from inertial.estimation.model import Model
from inertial.estimation.penalty import price
from inertial.estimation.term import Term

__all__ = ["CLASS_WIDTH", "EffectClass", "Member", "class_of"]


_MOST = 9
"""Rivals whose own noise is estimated."""

_FEWEST = 3
"""Axes of a unit, and units from which coefficients can be said to be alike."""


@dataclass(frozen=True)
class Member:
    """An effect that explains the data as well as the best of its class; ``score`` in chi-square behind the best."""

    term: Term
    score: float


@dataclass(frozen=True)
class EffectClass:
    """Effects that the data cannot separate, best first, with the result of the best of them.

    log_p : log probability of the same reduction by noise
    size : RMS of the effect beyond the part that the rest of the model absorbs, g
    alike : whether coefficients that are the same in all units explain as much as a sensor's own
    """

    members: tuple[Member, ...]
    log_p: float
    size: float
    alike: bool = False

    @property
    def scope(self) -> Literal["sensor", "slot", "station", "sensor or station", "data"]:
        """Where the cause is: "data", "sensor", "slot", "station", or "sensor or station" where the lot cannot tell."""
        if self.of_data:
            return "data"
        scopes = {m.term.effect.scope for m in self.physics} | ({"station"} if self.alike else set())
        return "sensor or station" if {"sensor", "station"} <= scopes else self.proposed.effect.scope

    @property
    def ids(self) -> tuple[str, ...]:
        """Effect ids, best first."""
        return tuple(m.term.effect.id for m in self.members)

    @property
    def proposed(self) -> Term:
        """The member to recommend: the simplest of those that the best does not lead clearly; handling errors come first."""
        near = [m for m in self.members if m.score < CLEAR_LEAD or isinstance(m.term.effect, Handling)]
        return min(near, key=lambda m: m.term.effect.simplicity).term

    @property
    def physics(self) -> tuple[Member, ...]:
        """The members that are effects."""
        return tuple(m for m in self.members if not isinstance(m.term.effect, Handling))

    @property
    def of_data(self) -> bool:
        """Whether a handling error explains the data as well as any effect."""
        return len(self.physics) < len(self.members)


def class_of(field: Candidates, model: Model, term: Term) -> EffectClass:
    """The class of a term beside all other terms of a model; every serious rival with its own noise."""
    rest = model.without_term(term)
    leave = {t.effect.id for t in rest.terms if not isinstance(t.effect, Handling)}
    looked = scanned(field, [rest.at(model.noise)], leave)[0]
    of_term = judge(field, rest, term)
    least = max((score for _, score in looked), default=0.0) - decisions.RIVAL_NEAR * _stretch(term, looked, of_term)
    near = [t for t, score in looked[:_MOST] if score > least and t.effect.id != term.effect.id]
    near = [t for t in near if term.effect.id not in t.effect.after]
    judged = [judge_refined(field, rest, t, model.noise) for t in near]
    judged = ranked([of_term, *judged])
    if isinstance(term.effect, Handling):
        # an effect that explains far more than an error of handling is beside it, and no rival of it
        held = next(rival for rival in judged if rival.term is of_term.term)  # ranked: at the noise of the best of them
        judged = [rival for rival in judged if rival is held or rival.cost > held.cost - CLASS_WIDTH]
    jumps = jumps_in_place_of(field, rest, judged[0])
    if jumps is not None:
        judged = _with_jumps(judged, jumps)
    best = judged[0]
    members = tuple(Member(r.term, r.cost - best.cost) for r in judged if r.cost < best.cost + CLASS_WIDTH)
    return EffectClass(members, best.log_p, size_of(rest, best.term), _alike(rest, best.term))


def _alike(model: Model, term: Term) -> bool:
    """Whether coefficients that all units share explain as much as coefficients of every unit, each at its price.

    What a table, a fixture or a reference does is the same in every unit; sensors of one design can have it alike, too.
    """
    units = model.problem.lot.state.time.shape[0]
    if units < _FEWEST or model.problem.lot.radial or term.shared:
        return False
    space, candidate = model.at(model.with_term(term).noise), term.candidate(model.problem)
    by_axis = np.eye(model.problem.per_unit)[np.arange(space.q.shape[0]) % model.problem.per_unit]
    columns = np.einsum("bngp,ba->bngap", candidate.of_blocks, by_axis)
    common = space.gain(Candidate(columns.reshape(*columns.shape[:3], -1), shared=True))
    each = space.gain(candidate)
    scores = [float(g.drop[0]) - price(float(g.drop[0]), float(g.rank[0])) for g in (common, each)]
    return scores[0] > scores[1] - CLASS_WIDTH


def _with_jumps(judged: list[Rival], jumps: Jumps) -> list[Rival]:
    """Rivals with the jumps of single axes instead of the best rival, at the score that the jumps have together."""
    best, first = judged[0], jumps.terms[0]
    same = next((r for r in judged if r.term.effect.id == first.effect.id), replace(best, term=first, ratio=None))
    others = [r for r in judged if r is not same]
    return sorted([*others, replace(same, cost=min(same.cost, best.cost - jumps.ahead))], key=lambda r: r.cost)


def _stretch(term: Term, looked: Sequence[tuple[Term, float]], of_term: Rival) -> float:
    """Factor by which scores at the noise of the best differ more than those of rivals each at its own noise; one at least.

    What wander could take up of a slow effect counts in full at a noise without it: with four soaks in one direction a cubic of
    the temperature has a score of a thousand there, and of forty at the noise that is estimated again.
    """
    at_this_noise = next((score for other, score in looked if other.effect.id == term.effect.id), 0.0)
    return max(at_this_noise / max(-of_term.cost, 1.0), 1.0)
