"""Bad dwells, except those that an effect explains at a lower price."""

from collections.abc import Sequence

import numpy as np

from inertial import effects as catalogue
from inertial.criticism.drivers import varies
from inertial.criticism.field import Candidates
from inertial.criticism.search import contest, convincing, judge
from inertial.data_errors.bad_dwells import bad_dwells
from inertial.data_errors.removed_dwells import BadDwell, model_without
from inertial.effects.base import AnyEffect
from inertial.effects.covariate import COVARIATE_PREFIX, Covariate
from inertial.estimation.model import Model
from inertial.estimation.penalty import price
from inertial.estimation.term import Term


def bad_beside_effects(base: Model, effects: Sequence[str]) -> list[BadDwell]:
    """The bad dwells of a lot, without those that an effect explains at a lower price than that of removing all of them.

    The first dwells of a sensor that warms up deviate most; if they are left out, the warm-up is no longer visible. An effect
    that explains a single dwell must be significant in the other dwells, too: otherwise it only restates that the dwell is bad.

    Parameters
    ----------
    effects : ids of the model
    """
    found = bad_dwells(base)
    if not found:
        return found
    rivals = candidates_of(base, effects)
    field = Candidates(base.problem, rivals)
    best = next(iter(contest(field, base)), None)
    if best is None or not convincing(field, base, best):
        return found
    beside_effect = bad_dwells(base.with_term(best.term))
    indices = {d.index for d in beside_effect}
    explained = [d for d in found if d.index not in indices]
    if not explained or -best.cost <= sum(_score(base, d) for d in explained):
        return found
    return beside_effect if len(explained) > 1 or _seen_without(base, rivals, best.term, explained) else found


def _seen_without(base: Model, effects: list[AnyEffect], term: Term, bad: list[BadDwell]) -> bool:
    """Whether a term exceeds its price, by the margin of a single test, with the bad dwells left out."""
    rest = model_without(base, [d.index for d in bad])
    return -judge(Candidates(rest.problem, effects), rest, term).cost > float(np.log(max(rest.problem.count, 1)))


def _score(base: Model, bad: BadDwell) -> float:
    """Reduction of the deviance by removing a bad dwell, less the price of its deviation and of the choice among all dwells."""
    units, n = base.problem.lot.state.time.shape
    dof = max(base.space.dof, 1)
    drop = dof * float(np.log1p(bad.deviations**2 / dof))
    return drop - price(drop, bad.by_axis.size) - 2.0 * float(np.log(units * n))


def candidates_of(base: Model, held: Sequence[str]) -> list[AnyEffect]:
    """Effects of the catalogue and recorded covariates that are not among the ids ``held`` by the model."""
    state = base.problem.lot.state
    effects = [e for e in catalogue.catalogue().values() if e.id not in set(held)]
    names = [name for name, values in state.covariates.items() if varies(values)]
    return [*effects, *(Covariate(name) for name in names if f"{COVARIATE_PREFIX}{name}" not in set(held))]
