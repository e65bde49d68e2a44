"""Groups of a family, such as wafers: what units of one group have in common, from units of it in other lots.

Two units of one group in different lots share nothing but the group: the mean product of their departures from the family is the
covariance W between groups, whatever the lots have in common. The mean of a group is then the best linear predictor from the
means of its units by lot (C. R. Henderson, Biometrics 31 (1975) 423), and a new unit of it has the covariance of the family
less what the group explains.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Index
from inertial.counts import number_of
from inertial.errors import NotIdentified
from inertial.population.family import SPARE, Family

_MOST = 0.95
"""Largest share of the covariance of a family that its groups explain: more is not known from so few of them."""


@dataclass(frozen=True)
class Groups:
    """The groups of a family.

    spread : (m, p, p), covariance W between groups
    shift : name → (m, p), what units of a group depart from the family by · left : name → (m, p, p), covariance of that
    """

    family: Family
    spread: Array
    shift: dict[str, Array]
    left: dict[str, Array]

    def of(self, name: str) -> tuple[Array, Array]:
        """Mean (m, p) and covariance (m, p, p) of a unit of a group, in a lot of its own."""
        of_family = self.family.within + self.family.between
        return self.family.mean + self.shift[name], of_family - self.spread + self.left[name]


def groups_of(family: Family, values: Array, covariance: Array, lot: Index, group: Sequence[str]) -> Groups:
    """The groups of the units that a family was made of.

    Parameters
    ----------
    values, covariance, lot : as of :func:`inertial.population.family.family_of`
    group : (units,), name of the group of each; empty where it is not known

    Raises
    ------
    NotIdentified
        Too few groups have units in more than one lot: groups and lots cannot be told apart.
    """
    p = values.shape[-1]
    apart = values - family.mean
    lots: dict[str, dict[int, list[int]]] = {}
    for k, name in enumerate(group):
        if name:
            lots.setdefault(name, {}).setdefault(int(lot[k]), []).append(k)
    crossed = [list(of_lots.values()) for of_lots in lots.values() if len(of_lots) > 1]
    if len(crossed) < p + SPARE:
        raise NotIdentified(
            f"prior: {number_of(len(crossed), 'group')} of the attribute with units in more than one lot, {p + SPARE} are needed "
            "to tell groups from lots; leave 'attribute' out of [prior]"
        )
    products = np.stack([_between_lots([apart[units].mean(axis=0) for units in each]) for each in crossed])
    # less a standard error: too large a share of the groups would make the prior of a unit too narrow
    mean, error = products.mean(axis=0), products.std(axis=0, ddof=1) / np.sqrt(len(products))
    spread = _within_limits(mean - error * np.eye(p), family.within + family.between)
    shift, left = dict[str, Array](), dict[str, Array]()
    for name, of_lots in lots.items():
        information, pull = np.zeros_like(spread), np.zeros_like(family.mean)
        for units in of_lots.values():
            variance = (family.within + covariance[units].mean(axis=0)) / len(units) + family.between
            weight = np.linalg.inv(variance)
            information += weight
            pull += np.einsum("aij,aj->ai", weight, apart[units].mean(axis=0))
        # W may have no inverse: (W⁻¹ + I)⁻¹ = W − W·(W + I⁻¹)⁻¹·W
        gain = spread @ np.linalg.inv(spread + np.linalg.inv(information))
        left[name] = spread - gain @ spread
        shift[name] = np.einsum("aij,aj->ai", left[name], pull)
    return Groups(family, spread, shift, left)


def _between_lots(means: Sequence[Array]) -> Array:
    """Mean product (m, p, p) of the means (m, p) of a group in different lots, symmetric."""
    total, squares = np.sum(means, axis=0), np.einsum("kai,kaj->aij", np.stack(means), np.stack(means))
    return (np.einsum("ai,aj->aij", total, total) - squares) / (len(means) * (len(means) - 1))


def _within_limits(spread: Array, total: Array) -> Array:
    """A covariance (m, p, p) that is positive and explains no more than most of a total (m, p, p)."""
    root = np.linalg.cholesky(total)
    inverse = np.linalg.inv(root)
    values, vectors = np.linalg.eigh(inverse @ spread @ np.swapaxes(inverse, -1, -2))
    turned = root @ vectors
    limited = np.clip(values, 0.0, _MOST)
    return np.asarray((turned * limited[..., None, :]) @ np.swapaxes(turned, -1, -2), dtype=np.float64)
