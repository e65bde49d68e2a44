"""Influence of dwells on a verdict: their shares of the deviance, and the verdict without the most influential ones."""

from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array
from inertial.data_errors.removed_dwells import model_without
from inertial.estimation.likelihood import common_part, of_station, scatter_beside, shared_noise, weighed
from inertial.estimation.model import Model
from inertial.estimation.penalty import fall, freedom
from inertial.estimation.term import Term

_MOST, _MOST_DWELLS = 8, 3
_CARRY = 0.5
"""Total share of the deviance above which no further dwell is listed."""


@dataclass(frozen=True)
class Influence:
    """A dwell of a unit, and its share of the verdict's deviance."""

    unit: int
    dwell: int
    share: float


def influence(model: Model, term: Term | None) -> tuple[Influence, ...]:
    """The dwells of largest influence on a verdict, largest first.

    Parameters
    ----------
    model : the model to which the term is added; term : the identified effect, None for the residuals of the model
    """
    before = model.space.residual
    carried = before**2
    if term is not None:
        richer = model.with_term(term)
        carried = before**2 - richer.at(model.noise).residual ** 2
    units = model.problem.lot.state.time.shape[0]
    each = carried.reshape(units, -1, model.problem.n).sum(axis=1)
    total = float(np.sum(np.maximum(each, 0.0)))
    if total <= 0.0:
        return ()
    if term is not None and of_station(term):
        # an effect on all units depends on a dwell in all of them: left out in one unit, the others would still show it
        return _dwells_of_all_units(each / total)
    influences: list[Influence] = []
    for index in np.argsort(each, axis=None)[::-1][:_MOST].tolist():
        unit, dwell = divmod(index, model.problem.n)
        share = float(each[unit, dwell]) / total
        if share <= 0.0 or sum(f.share for f in influences) > _CARRY:
            break
        influences.append(Influence(unit, dwell, share))
    return tuple(influences)


def _dwells_of_all_units(share: Array) -> tuple[Influence, ...]:
    """The dwells of largest share summed over the units, each listed for every unit; ``share`` : (units, n)."""
    total = share.sum(axis=0)
    influences: list[Influence] = []
    for dwell in np.argsort(total)[::-1][:_MOST_DWELLS].tolist():
        if total[dwell] <= 0.0 or sum(f.share for f in influences) > _CARRY:
            break
        units = np.argsort(share[:, dwell])[::-1].tolist()
        influences += [Influence(unit, dwell, max(float(share[unit, dwell]), 0.0)) for unit in units]
    return tuple(influences)


@dataclass(frozen=True)
class CarriedEvidence:
    """Dwells of largest influence on a term, and the log probability of the term when they are left out."""

    dwells: tuple[Influence, ...] = ()
    log_p_without: float | None = None


def carried_by(model: Model, term: Term) -> CarriedEvidence:
    """The dwells of largest influence on a term of a model, and the verdict without them."""
    dwells = influence(model, term)
    return CarriedEvidence(dwells, log_p_without(model, term, dwells) if dwells else None)


def log_p_without(model: Model, term: Term, dwells: tuple[Influence, ...]) -> float:
    """Log probability of a term without the given dwells, at the noise of the model."""
    rest = model_without(model, [(d.unit, d.dwell) for d in dwells])
    space = rest.at(model.noise)
    gain = space.gain(term.candidate(rest.problem))
    rank = int(gain.rank[0])
    if rank == 0:
        return 0.0
    richer = model.with_term(term)
    common = replace(
        common_part(space, term, rest.problem, gain), noise=max(shared_noise(richer), scatter_beside(richer, term))
    )
    return weighed(float(fall(space, gain)[0]), rank, freedom(term), common=common).log_p
