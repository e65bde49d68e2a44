"""Numbers in the findings of procedures: expanded uncertainties to two digits, values to the same place, signs, probabilities."""

from __future__ import annotations

import math
from collections.abc import Sequence

from inertial.counts import degrees_of_freedom
from inertial.dynamics.goodness import Fitted, adequate, p_value
from inertial.uncertainty.rounding import equal, rounded

MINUS = "−"
SMALLEST_FIXED, LARGEST_FIXED = 1e-5, 1e8  # of U in fixed notation


def with_uncertainty(value: float, expanded: float) -> str:
    """``value ± U``, U to two digits and the value to the same place (GUM 7.2.6)."""
    if not math.isfinite(expanded) or expanded <= 0.0:
        return f"{value:.4g}".replace("-", MINUS)
    if not SMALLEST_FIXED <= expanded < LARGEST_FIXED:
        return f"{value:.3e} ± {expanded:.1e}".replace("-", MINUS)
    return " ± ".join(rounded(value, expanded)).replace("-", MINUS)


def verdict_of(fit: Fitted) -> str:
    """Verb phrase of a fit's verdict with its evidence: ``is adequate: χ² 3.2 for 4 degrees of freedom, p = 0.53``."""
    verdict = {None: "cannot be judged", True: "is adequate", False: "is not adequate"}[adequate(fit)]
    return f"{verdict}: χ² {fit.chi_square:.1f} for {degrees_of_freedom(fit.dof)}, {probability(p_value(fit))}"


def not_separated(effects: Sequence[str], by: str) -> str:
    """End of the sentence on a missing effect: the others of its class, which ``by`` (``the points``) does not separate."""
    return f"; {by} do not separate it from {', '.join(effects[1:])}" if len(effects) > 1 else ""


def improvement(before: str, after: str, what: str, left_out: tuple[float, float]) -> str:
    """What the missing effects bring: rms residuals with their unit, and residuals of what was left out (``points``)."""
    text = f"rms residual {before} → {after}; {what} left out, in standard uncertainties: "
    return f"{text}{left_out[0]:.2f} → {left_out[1]:.2f}"


def signed(value: float, places: int) -> str:
    """A difference with its sign to some places; what rounds to zero has none."""
    shown = round(value, places)
    text = f"{shown:+.{places}f}" if shown else f"{0.0:.{places}f}"
    return text.replace("-", MINUS)


def probability(p: float) -> str:
    """A probability with its sign: ``p = 0.68``, ``p < 0.001``."""
    return f"p {equal(p)}"
