"""Numbers in the findings of procedures: expanded uncertainties to two digits, values to the same place, signs, probabilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from inertial.counts import degrees_of_freedom
from inertial.dynamics.missing_effects import Fitted, adequate, p_value
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


def diagnosis_texts(
    diagnosis: Any,
    subject: str,
    first: Sequence[str],
    size: Callable[[str], str],
    rms: tuple[str, str, str],
    counted: tuple[str, str],
    unexplained: str,
    where: str = "",
) -> list[tuple[str, str]]:
    """The diagnosis of a model in sentences: subject and text.

    Parameters
    ----------
    first : terms of every model; size : that of an effect, with its uncertainty
    rms : residuals without and with the missing effects, and their unit
    counted : what residuals are counted in, and what does not separate effects (``points``, ``the points``)
    unexplained : what to do about a residual that no effect explains; where : part of the data with the misfit
    """
    model = " + ".join((*first, *diagnosis.fit.effects))
    if diagnosis.adequate is None:
        return [(subject, f"{model} cannot be judged: {diagnosis.reason}")]
    (before, after, unit), (left_out, by) = rms, counted
    verdict = "adequate" if diagnosis.adequate else "not adequate"
    text = f"{model} is {verdict} ({probability(p_value(diagnosis.fit))}), rms residual {before} {unit}"
    out = [(subject, text + where)]
    for one in diagnosis.classes:
        effect, *rivals = one.effects
        alike = f"; {by} do not separate it from {', '.join(rivals)}" if rivals else ""
        out.append(("missing effect", f"{effect}: {size(effect)}, {probability(one.p_value)}{alike}"))
    if diagnosis.classes:
        held = " → ".join(f"{value:.2f}" for value in diagnosis.left_out)
        text = f"rms residual {before} → {after} {unit}; {left_out} left out, in standard uncertainties: {held}"
        out.append(("with the missing effects", text))
    if diagnosis.unexplained:
        out.append(("unexplained", f"no known effect explains {unexplained}"))
    return [*out, *(("next measurement", step) for step in diagnosis.next_steps)]


def signed(value: float, places: int) -> str:
    """A difference with its sign to some places; what rounds to zero has none."""
    shown = round(value, places)
    text = f"{shown:+.{places}f}" if shown else f"{0.0:.{places}f}"
    return text.replace("-", MINUS)


def probability(p: float) -> str:
    """A probability with its sign: ``p = 0.68``, ``p < 0.001``."""
    return f"p {equal(p)}"
