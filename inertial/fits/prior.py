"""The prior of a lot from the family of its units: judged by the lot's own fit, then combined with it.

A prior of mean m and covariance P counts as one more observation of every coefficient beside the fit: with the covariance C of
the fit the estimate is θ + K·(m − θ), K = C·(C + P)⁻¹. That is the fit of all observations together, since the dwells of a fit
say nothing more of its coefficients than estimate and covariance.

It is a prior for units like those of the family. The lot's own estimates are compared with it, effect by effect: where their mean
or their spread is further from the family than both covariances allow, the prior of the whole lot is widened until they agree;
a unit that is unlike the family and unlike its lot gets none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Flags, Places
from inertial.decisions import FOREIGN_LOT, FOREIGN_UNIT
from inertial.distributions import chi2_tail, f_tail
from inertial.population.family import Family, with_prior

_WIDEST, _HALVINGS = 1e8, 60


@dataclass(frozen=True)
class Prior:
    """The prior of the units of a lot after its comparison with them.

    mean : (units, m, p), of the family, or of a unit's own earlier calibrations
    covariance : (units, m, p, p), of the coefficients about it, as widened
    precision : (units, m, p, p), its inverse; zero for units that do not fit the family
    p_unit : (units,), probability that a unit of the family is as far from its prior in its furthest effect
    widened : per effect, factors (≥ 1) of the covariance within and between lots
    """

    family: Family
    mean: Array
    covariance: Array
    precision: Array
    p_unit: Array
    widened: dict[str, tuple[float, float]]

    @property
    def fits(self) -> Flags:
        """Units (units,) that have a prior."""
        return np.any(self.precision != 0.0, axis=(-3, -2, -1))


@dataclass(frozen=True)
class Combined:
    """A fit with its prior.

    coefficients, covariance : as in the fit
    of_fit : (units, m, p, p), derivative of the coefficients by those of the fit alone
    share : (units, m, p), share of the prior in the variance of every coefficient
    """

    coefficients: Array
    covariance: Array
    of_fit: Array
    share: Array


def combined(coefficients: Array, covariance: Array, mean: Array, precision: Array) -> Combined:
    """Estimates (units, m, p) with covariances (units, m, p, p) together with a prior; a precision of zero changes nothing."""
    both = with_prior(covariance, precision)
    pull = both @ precision
    of_prior = np.diagonal(pull @ both, axis1=-2, axis2=-1) / np.diagonal(both, axis1=-2, axis2=-1)
    step = np.einsum("...ij,...j->...i", pull, mean - coefficients)
    return Combined(coefficients + step, both, np.eye(pull.shape[-1]) - pull, of_prior)


def judged(
    family: Family, effects: Sequence[str], coefficients: Array, covariance: Array, units: Sequence[str] = ()
) -> Prior:
    """The prior of a lot, by its own estimates.

    Parameters
    ----------
    units : serial numbers, by which units with earlier calibrations are known; none has any where empty
    effects : (p,), effect of every column
    coefficients : (units, m, p), of the fit without a prior; covariance : (units, m, p, p)
    """
    shape = covariance.shape
    mean, within, between = (
        np.array(np.broadcast_to(moment, over))
        for moment, over in ((family.mean, shape[:-1]), (family.within, shape), (family.between, shape))
    )
    for k, unit in enumerate(units):
        if unit in family.own:
            (mean[k], within[k]), between[k] = family.own[unit], 0.0
    apart = coefficients - mean
    names = list(dict.fromkeys(effects))
    columns = {name: np.flatnonzero(np.array(effects, dtype=object) == name) for name in names}
    parts = [
        _Part(columns[name], apart, covariance, within, between, float(family.tails[:, columns[name]].min()))
        for name in names
    ]
    alone = np.min([part.p_units(1.0, 1.0) for part in parts], axis=0) * len(parts)
    suspect = alone < FOREIGN_UNIT
    # most of a lot that is unlike the family: the lot is, and its units are judged by one another; a single unit has no others
    reference = ~suspect if 2 * suspect.sum() <= len(apart) or len(apart) == 1 else np.ones_like(suspect)
    factors = [part.widening(reference, FOREIGN_LOT / (2 * len(parts))) for part in parts]
    p_unit = np.minimum(
        np.min([part.p_units(*f) for part, f in zip(parts, factors, strict=True)], axis=0) * len(parts), 1.0
    )
    foreign = p_unit < FOREIGN_UNIT
    wider = np.ones((2, len(effects)))
    for name, factor in zip(names, factors, strict=True):
        wider[:, columns[name]] = np.sqrt(factor)[:, None]
    prior_covariance = within * np.outer(wider[0], wider[0]) + between * np.outer(wider[1], wider[1])
    precision = np.where(foreign[:, None, None, None], 0.0, np.linalg.inv(prior_covariance))
    widened = {name: factor for name, factor in zip(names, factors, strict=True) if max(factor) > 1.0}
    return Prior(family, mean, prior_covariance, precision, p_unit, widened)


class _Part:
    """The columns of one effect: how far units and lot are from the family, at factors of its covariances."""

    def __init__(
        self, columns: Places, apart: Array, covariance: Array, within: Array, between: Array, tails: float
    ) -> None:
        cut = (..., columns[:, None], columns)
        self.error, self.within, self.between = covariance[cut], within[cut], between[cut]
        self.apart, self.tails = apart[..., columns], tails
        self.dof = self.apart[0].size
        # heavy tails: the variance of a sum of squares is that of fewer degrees of freedom
        self.effective = 1.0 / (1.0 + 3.0 / (self.tails - 4.0))

    def p_units(self, within: float, between: float) -> Array:
        """Probability (units,) of a unit of the family further from its mean, by Student's distribution of the family's tails."""
        square = _square(self.apart, self.error + within * self.within + between * self.between).sum(axis=-1)
        scaled = square / self.dof * self.tails / (self.tails - 2.0)
        return np.where(self.tails < 1e5, f_tail(scaled, self.dof, self.tails), chi2_tail(square, self.dof))

    def widening(self, units: Flags, limit: float) -> tuple[float, float]:
        """Factors of the covariance within and between lots with which some units agree with the family; one where they do."""
        count = int(units.sum())
        within = 1.0
        if count > 1:
            within = _factor(lambda f: self._spread(units, f)[0], self.dof * (count - 1), limit, self.effective)
        between = _factor(lambda f: self._middle(units, within, f), self.dof, limit, 1.0) if count else 1.0
        return within, between

    def _spread(self, units: Flags, within: float) -> tuple[float, Array, Array]:
        """χ² of the units about their mean; that mean (m, k), and its covariance (m, k, k) about the lot's."""
        weight = np.linalg.inv(self.error[units] + within * self.within[units])
        error = np.linalg.inv(weight.sum(axis=0))
        middle = np.einsum("aij,uajk,uak->ai", error, weight, self.apart[units])
        left = self.apart[units] - middle
        return float(np.einsum("uai,uaij,uaj->", left, weight, left)), middle, error

    def _middle(self, units: Flags, within: float, between: float) -> float:
        """χ² of the mean of the units."""
        _, middle, error = self._spread(units, within)
        return float(_square(middle, error + between * self.between[units].mean(axis=0)).sum())


def _square(apart: Array, covariance: Array) -> Array:
    return np.einsum("...i,...i->...", apart, np.linalg.solve(covariance, apart[..., None])[..., 0])


def _factor(chi2: Callable[[float], float], dof: int, limit: float, effective: float) -> float:
    """The factor of a covariance with which χ² is its degrees of freedom, where at 1 its probability is below a limit.

    effective : share of the degrees of freedom that counts in the probability
    """
    if float(chi2_tail(effective * chi2(1.0), effective * dof)) >= limit:
        return 1.0
    low, high = 0.0, np.log(_WIDEST)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if chi2(float(np.exp(middle))) > dof else (low, middle)
    return float(np.exp(high))
