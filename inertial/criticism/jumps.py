"""Jumps of single axes in place of an effect or of slow noise: telegraph noise of a few axes can imitate both.

An effect has coefficients for every unit and axis, so that one effect explains independent jumps of three axes better than any
single jump does. The jumps of a few axes together are therefore compared with the effect, at the same noise. Slow noise follows
jumps up and down, too: each of them alone leaves it as it is, all of them together leave none.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb, log

import numpy as np

from inertial.arrays import Array
from inertial.criticism.field import Candidates, Rival
from inertial.decisions import CLASS_WIDTH, JUMPS_RARE, LESS_FLICKER, LESS_WALK, NAMED_BELOW
from inertial.estimation.alternative import Handling
from inertial.estimation.bases import SEEN
from inertial.estimation.candidate import Candidate
from inertial.estimation.likelihood import restricted_deviance
from inertial.estimation.model import Model
from inertial.estimation.penalty import freedom, price
from inertial.estimation.space import Space
from inertial.estimation.term import Term
from inertial.probability import log_chi2_tail, log_f_tail

_AXES = 6
"""Largest number of axes whose jumps may replace one effect."""

_JUMPS = 4
"""Largest number of jumps of one axis."""


@dataclass(frozen=True)
class Jumps:
    """Jumps of single axes in place of an effect.

    terms : all jumps, those of the axis with the largest gain first; ahead : their total score less that of the effect
    """

    terms: tuple[Term, ...]
    ahead: float


@dataclass(frozen=True)
class _AxisJumps:
    """The best jumps of one axis, with their score."""

    score: float = 0.0
    terms: tuple[Term, ...] = ()


_NONE = _AxisJumps()


def jumps_in_place_of(field: Candidates, model: Model, *rivals: Rival) -> Jumps | None:
    """The jumps of single axes that explain about as much as effects with coefficients for every axis; None if none do."""
    alternatives = [a for a in field.handling if a.of_one_axis]
    if not alternatives or not all(rival.rank and not rival.term.shared for rival in rivals):
        return None
    terms = [rival.term for rival in rivals]
    space = model.at(Model(model.problem, [*model.terms, *terms], near=model.noise).noise)
    # the noise is estimated with the effects in the model; at this fixed noise deviances are sums of squares
    columns = np.concatenate([term.candidate(model.problem).of_blocks for term in terms], axis=-1)
    drops = _drops(space, Candidate(columns, shared=False, per_unit=field.problem.per_unit))
    coefficients = sum(rival.rank for rival in rivals), sum(map(freedom, terms))
    score = _score(drops, *coefficients, field.problem.per_unit)
    largest = np.argsort(drops)[::-1][:_AXES]
    # on the same axes jumps explain at most 1.5 times as much as an effect
    if 1.5 * float(drops[largest].sum()) < score - CLASS_WIDTH:
        return None
    single = _single_jumps(field, space, alternatives)
    of_axes = sorted((_best(field, space, int(b), single) for b in largest), key=lambda of_axis: -of_axis.score)
    together, terms = 0.0, list[Term]()
    for found in of_axes:
        gain = found.score - (JUMPS_RARE if terms else 0.0)
        if gain > 0.0:
            together += gain
            terms += found.terms
    ahead = float(together - score)
    return Jumps(tuple(terms), ahead) if terms and ahead > -CLASS_WIDTH else None


def jumps_in_place_of_wander(field: Candidates, model: Model) -> tuple[Term, ...]:
    """The jumps of a single axis that explain more than its slow noise in a model; empty if there are none."""
    shares, blocks = model.noise.shares, field.problem.blocks
    # the slow noise of a lot of many axes is not that of a few; a single jump is judged at the noise of every rival
    slow = [block for block in range(blocks) if blocks <= 2 * _AXES or shares.of_block(block) != shares.common]
    tried, most = tuple[Term, ...](), 0.0
    lower = [shares.times(*parts) for parts in ((1.0, 0.0), (LESS_FLICKER, LESS_WALK), (0.0, 0.0))]
    for less in dict.fromkeys(each for each in lower if each != shares):
        space = model.at(model.noise_at(less))
        found = max((_best(field, space, block, {}) for block in slow), key=lambda jumps: jumps.score, default=_NONE)
        gain = _beyond_wander(field, model, found.terms) if found.terms and not _single_dwells(found.terms) else 0.0
        if gain > most:
            tried, most = found.terms, gain
    return tried


def _single_dwells(jumps: tuple[Term, ...]) -> bool:
    """Whether jumps only lead to a dwell and back: it is then a bad dwell, which is judged as such."""
    dwells = [int(jump.location["dwell"]) for jump in jumps]
    return len(dwells) % 2 == 0 and all(b - a == 1 for a, b in zip(dwells[::2], dwells[1::2], strict=True))


def _beyond_wander(field: Candidates, model: Model, jumps: tuple[Term, ...]) -> float:
    """Score of jumps of an axis, with the noise estimated again; zero if they are not significant over all tests."""
    richer = Model(model.problem, [*model.terms, *jumps], near=model.noise)
    deviance = restricted_deviance(model.space, model.space) - restricted_deviance(model.at(richer.noise), richer.space)
    count, looks = len(jumps), field.looks
    chosen = log(comb(field.problem.n - 1, count) * field.problem.blocks) + 0.5 * JUMPS_RARE
    score = deviance - price(deviance, count) - 2.0 * chosen
    likely = float(log_chi2_tail(deviance, count)) + chosen + log(max(looks, 1)) > log(NAMED_BELOW)
    return 0.0 if likely or score < log(max(field.problem.count, 1)) else score


def _drops(space: Space, candidate: Candidate) -> Array:
    """Reduction of each block's residual sum of squares by an effect, (blocks,), beside the shared terms."""
    white = space.whiten(candidate.at(0))
    columns = space.project(white)
    before, size = (np.sqrt(np.einsum("bnp,bnp->bp", each, each)) for each in (white, columns))
    columns = columns * np.where(size > SEEN * before, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)[:, None, :]
    inverse = np.linalg.pinv(np.swapaxes(columns, -1, -2) @ columns, rcond=SEEN**2, hermitian=True)
    along = np.einsum("bnp,bn->bp", columns, space.residual)
    drops = np.einsum("bp,bpq,bq->b", along, inverse, along)
    # scaled up to the total with the shared coefficients estimated again
    together, total = float(space.gain(candidate).drop[0]), max(float(drops.sum()), 1e-300)
    return drops * max(together / total, 1.0)


def _score(drops: Array, rank: int, nonlinear: int, per_unit: int) -> float:
    """Score of effects: best of all axes, one axis of all units, and one unit; each penalised for uneven reductions."""
    by_unit = drops.reshape(-1, per_unit)
    scores: list[float] = []
    for parts in (by_unit.reshape(1, -1), by_unit.T, by_unit):
        part = parts[int(np.argmax(parts.sum(axis=1)))]
        drop = float(part.sum())
        paid = price(drop, rank / len(parts) + nonlinear) + 2.0 * float(np.log(len(parts)))
        scores.append(drop - paid + _evenness(part))
    return max(scores)


def _evenness(drops: Array) -> float:
    """Twice the log probability that the largest of the reductions (k,) exceed the others by as much; zero if that is usual.

    For coefficients from one normal distribution each reduction is chi-square with one degree of freedom, so that the ratio of
    the m largest to the others has an F distribution, for each of the possible choices. Noise alone reduces each by 1 on average.
    """
    ordered = np.sort(drops)[::-1]
    count = ordered.size
    unlikely = 0.0
    for m in range(1, count):
        top, rest = float(ordered[:m].sum()), float(ordered[m:].sum())
        ratio = (top / m) / max(rest / (count - m), 1.0)
        chances = log(comb(count, m) * count)  # Python integers: numpy's would overflow in large lots
        unlikely = min(unlikely, 2.0 * (float(log_f_tail(ratio, m, count - m)) + chances))
    return unlikely


def _single_jumps(field: Candidates, space: Space, alternatives: Sequence[Handling]) -> dict[int, _AxisJumps]:
    """The best single-axis handling error of each block at its best location, by block index."""
    best: dict[int, _AxisJumps] = {}
    for alternative in alternatives:
        gain = field.gain_of(space, alternative)
        paid = 2.0 * float(np.log(field.looks_of(alternative.id)))
        tried = zip(field.grids[alternative.id], gain.drop.tolist(), gain.rank.tolist(), strict=True)
        for location, drop, rank in tried:
            block = int(field.problem.per_unit * location["unit"] + location["axis"])
            score = drop - price(drop, rank) - paid
            if block not in best or score > best[block].score:
                best[block] = _AxisJumps(float(score), (Term(alternative, tuple(location.items())),))
    return best


def _best(field: Candidates, space: Space, block: int, single: dict[int, _AxisJumps]) -> _AxisJumps:
    """The best jumps of one block: a single handling error, or several jumps from level to level."""
    axes = len(space.q)
    tried = [_NONE, *([single[block]] if block in single else [])]
    jump = next((a for a in field.handling if a.several and a.id in field.grids), None)
    if jump is not None:
        unit, axis = divmod(block, field.problem.per_unit)
        for drop, dwells in _several(space, block):
            chosen = float(np.log(comb(space.q.shape[1] - 1, len(dwells)) * axes))
            here = (("unit", float(unit)), ("axis", float(axis)))
            terms = tuple(Term(jump, (*here, ("dwell", float(k)))) for k in dwells)
            tried.append(_AxisJumps(drop - price(drop, len(dwells)) - 2.0 * chosen, terms))
    return max(tried, key=lambda of_axis: of_axis.score)


def _several(space: Space, block: int) -> Iterator[tuple[float, list[int]]]:
    """Reductions of the deviance by two and more jumps of a block, with the dwells of the jumps; added greedily in pairs."""
    n = space.q.shape[1]
    dwells, blocks = np.arange(1, n), np.array([block])
    steps = (np.arange(n)[:, None] >= dwells).astype(np.float64)[None]
    white = space.project(
        space.covariance.whiten(steps, space.noise.shares, blocks) / space.noise.scale[block], blocks
    )[0]
    gram, along = white.T @ white, white.T @ space.residual[block]
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    gram, along = gram / size[:, None] / size, along / size
    chosen: list[int] = []
    while len(chosen) < _JUMPS:
        chosen += _next_two(gram, along, chosen) if len(chosen) + 2 <= _JUMPS else []
        some = gram[np.ix_(chosen, chosen)]
        drop = float(along[chosen] @ np.linalg.lstsq(some, along[chosen], rcond=1e-8)[0])
        yield drop, [int(dwells[k]) for k in sorted(chosen)]


def _next_two(gram: Array, along: Array, chosen: list[int]) -> list[int]:
    """Indices of the two columns that reduce the sum of squares most beside the chosen ones."""
    if chosen:
        beside = np.linalg.lstsq(gram[np.ix_(chosen, chosen)], gram[chosen], rcond=1e-8)[0]
        gram, along = gram - gram[:, chosen] @ beside, along - beside.T @ along[chosen]
    diagonal = np.diag(gram)
    determinant = diagonal[:, None] * diagonal - gram**2
    squares = along[:, None] ** 2 * diagonal + along**2 * diagonal[:, None] - 2.0 * along[:, None] * along * gram
    seen = determinant > 1e-3
    drop = np.where(seen, squares / np.where(seen, determinant, 1.0), 0.0)
    return [int(k) for k in np.unravel_index(int(np.argmax(drop)), drop.shape)]
