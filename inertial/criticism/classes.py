"""Classes of effects that the data cannot separate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from inertial import decisions
from inertial.criticism.field import Candidates, Rival
from inertial.criticism.jumps import Jumps, jumps_in_place_of
from inertial.criticism.search import judge, judge_refined, ranked, scanned, size_of
from inertial.decisions import CLASS_WIDTH, CLEAR_LEAD
from inertial.estimation.alternative import Handling
from inertial.estimation.model import Model
from inertial.estimation.penalty import price
from inertial.estimation.term import Term

__all__ = ["CLASS_WIDTH", "EffectClass", "Member", "class_of"]


_MOST = 9
"""Largest number of rivals for each of which the noise is estimated again."""

_FEWEST = 3
"""Smallest number of units for the test whether their coefficients are equal."""


@dataclass(frozen=True)
class Member:
    """An effect that explains the data as well as the best of its class; ``score``: chi-square by which it is worse."""

    term: Term
    score: float


@dataclass(frozen=True)
class EffectClass:
    """Effects that the data cannot separate, best first, with the result of the best of them.

    log_p : log probability that noise gives the same reduction
    size : RMS, g, of the effect beyond the part that the rest of the model absorbs
    alike : whether coefficients common to all units explain as much as separate coefficients for each sensor
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
        """The member to recommend: the simplest of those not clearly worse than the best; handling errors have priority."""
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
    """The class of a term, beside all other terms of a model; the noise is estimated again for every serious rival."""
    rest = model.without_term(term)
    leave = {t.effect.id for t in rest.terms if not isinstance(t.effect, Handling)}
    looked = scanned(field, [rest.at(model.noise)], leave)[0]
    of_term = judge(field, rest, term)
    least = max((score for _, score in looked), default=0.0) - decisions.RIVAL_NEAR * _score_stretch(
        term, looked, of_term
    )
    near = [t for t, score in looked[:_MOST] if score > least and t.effect.id != term.effect.id]
    near = [t for t in near if term.effect.id not in t.effect.after]
    judged = [judge_refined(field, rest, t, model.noise) for t in near]
    judged = ranked([of_term, *judged])
    if isinstance(term.effect, Handling):
        # an effect that explains far more than the handling error exists in addition to it and is no rival of it
        held = next(rival for rival in judged if rival.term is of_term.term)  # ranked: at the noise of the best of them
        judged = [rival for rival in judged if rival is held or rival.cost > held.cost - CLASS_WIDTH]
    jumps = jumps_in_place_of(field, rest, judged[0])
    if jumps is not None:
        judged = _with_jumps(judged, jumps)
    best = judged[0]
    members = tuple(Member(r.term, r.cost - best.cost) for r in judged if r.cost < best.cost + CLASS_WIDTH)
    return EffectClass(members, best.log_p, size_of(rest, best.term), _alike(rest, best.term))


def _alike(model: Model, term: Term) -> bool:
    """Whether coefficients common to all units explain as much as separate ones, each less its price.

    Effects of a table, a fixture or a reference are equal in every unit; sensors of one design can have equal effects, too.
    """
    units = model.problem.lot.state.time.shape[0]
    if units < _FEWEST or model.problem.lot.radial or term.shared:
        return False
    gain = model.at(model.with_term(term).noise).gain(term.candidate(model.problem))
    both = ((gain.common, gain.common_rank), (gain.drop, gain.rank))
    common, each = (float(drop[0]) - price(float(drop[0]), float(rank[0])) for drop, rank in both)
    return common > each - CLASS_WIDTH


def _with_jumps(judged: list[Rival], jumps: Jumps) -> list[Rival]:
    """The rivals with the jumps of single axes added, or moved up, at the score that these jumps have together."""
    best, first = judged[0], jumps.terms[0]
    same = next((r for r in judged if r.term.effect.id == first.effect.id), replace(best, term=first, ratio=None))
    others = [r for r in judged if r is not same]
    return sorted([*others, replace(same, cost=min(same.cost, best.cost - jumps.ahead))], key=lambda r: r.cost)


def _score_stretch(term: Term, looked: Sequence[tuple[Term, float]], of_term: Rival) -> float:
    """Ratio, at least 1, of the score of a term at the noise of the model with it to its score with the noise estimated again.

    At a noise without wander, the part of a slow effect that wander could absorb counts in full: with four soaks in one direction
    a cubic in temperature has a score of a thousand there, and of forty with the noise estimated again.
    """
    at_this_noise = next((score for other, score in looked if other.effect.id == term.effect.id), 0.0)
    return max(at_this_noise / max(-of_term.cost, 1.0), 1.0)
