"""Whether the fit of a model to the points of a test agrees with their uncertainties."""

from typing import Protocol

from inertial.distributions import chi2_tail
from inertial.probability import passes

ADEQUATE_P = 0.005
"""Below this probability of the residuals a model is not adequate."""


class Fitted(Protocol):
    """A fit of a model, weighted by the uncertainties of its points."""

    @property
    def chi_square(self) -> float:
        """Sum of the squared weighted residuals."""
        ...

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        ...


def p_value(fit: Fitted) -> float:
    """Probability of a larger χ² where the model is right; nan without degrees of freedom."""
    return float(chi2_tail(fit.chi_square, fit.dof))


def adequate(fit: Fitted) -> bool | None:
    """Whether a model agrees with its points; None where no degree of freedom is left to judge it."""
    return passes(p_value(fit), ADEQUATE_P)
