"""Figures of procedures and findings in words; the deciding axis of a figure, and the interval of the largest of several axes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from inertial.counts import degrees_of_freedom
from inertial.distributions import normal_upper
from inertial.dynamics.missing_effects import Fitted, adequate, p_value
from inertial.uncertainty.degrees import DeviationLaw
from inertial.uncertainty.rounding import equal, rounded
from pipelines.procedures.compared import ComparedResult, JudgedCurve

TAIL = 0.025
REACH_95 = float(normal_upper(TAIL))


@dataclass(frozen=True)
class FigureSpec:
    """A figure that limits may name: its key, unit, and meaning in one line.

    one_axis : the figure is that of a single axis, so that a limit may be a least value; of others the largest axis is stated
    """

    name: str
    unit: str
    meaning: str
    one_axis: bool = False


@dataclass(frozen=True)
class FigureValue:
    """A figure of one unit and axis.

    ``low`` and ``high`` are the ends of a 95 % interval. Where ``identified`` is False the value passes no limit, and ``note``
    states why, and a measurement that determines it; where ``measured`` is False the records cannot hold
    it. A standard deviation has ``dof`` degrees of freedom, nan for other figures,
    and ``removed`` is the known part that was taken out of it; see :class:`inertial.uncertainty.degrees.DeviationLaw`.
    """

    figure: str
    axis: str
    value: float
    uncertainty: float
    low: float = float("nan")
    high: float = float("nan")
    identified: bool = True
    note: str = ""
    dof: float = float("nan")
    removed: float = 0.0
    measured: bool = True

    @classmethod
    def not_determined(
        cls, figure: str, axis: str, note: str, low: float = float("nan"), high: float = float("nan")
    ) -> Self:
        """A figure without a value, with the reason."""
        return cls(figure, axis, float("nan"), float("nan"), low, high, identified=False, note=note)

    @classmethod
    def not_measured(cls, figure: str, axis: str, note: str) -> Self:
        """A figure that the records cannot hold, with what would give it."""
        return replace(cls.not_determined(figure, axis, note), measured=False)


Texts = Sequence[tuple[str, str]]
"""Statements: subject and text."""


UnitOutcome = tuple[list[FigureValue], Texts]
"""The figures of one unit, and the statements on it."""


@dataclass(frozen=True)
class Finding:
    """A statement on one unit, or the lot (empty unit): its subject and the text."""

    unit: str
    subject: str
    text: str


@dataclass(frozen=True)
class Outcome:
    """The results of a procedure for the units of a lot; by unit.

    results, curves : of comparisons
    """

    figures: Mapping[str, list[FigureValue]]
    findings: Sequence[Finding] = ()
    results: Mapping[str, Sequence[ComparedResult]] = field(default_factory=dict[str, "Sequence[ComparedResult]"])
    curves: Mapping[str, Sequence[JudgedCurve]] = field(default_factory=dict[str, "Sequence[JudgedCurve]"])


def worst(values: Sequence[FigureValue]) -> FigureValue:
    """The deciding axis: an axis that is not identified or no number, else the largest magnitude plus twice its uncertainty.

    Its interval is that of the largest magnitude of all axes; see :func:`interval_of_largest`.
    """

    def size(value: FigureValue) -> float:
        bound = abs(value.value) + 2.0 * value.uncertainty
        return bound if np.isfinite(bound) else np.inf  # max() passes over a nan that is not the first

    missing = next((value for value in values if not value.identified), None)
    if missing is not None:
        return missing
    deciding = max(values, key=size)
    if len(values) == 1 or not np.isfinite(size(deciding)) or not deciding.uncertainty > 0.0:  # a limit has no interval
        return deciding
    low, high = interval_of_largest(values, -1.0 if deciding.value < 0.0 else 1.0)
    return replace(deciding, low=low, high=high)


def interval_of_largest(values: Sequence[FigureValue], sign: float) -> tuple[float, float]:
    """Ends of an interval that holds the largest of n magnitudes with at least 95 %, with the sign of the deciding axis.

    The largest of n estimates is chosen by its noise: the interval of that axis alone holds the largest magnitude of three equal
    ones in 81 to 86 %. The upper end is the largest of the axes' upper ends, each of 97.5 %: that of the axis with the largest
    true value is among them. The lower end is the largest of lower ends of 0.975^(1/n) each, so that all n hold together with
    97.5 % (Šidák). Where it is below zero the sign is open, and the interval is the hull of the intervals of all axes.
    """
    ends = [_ends(value) for value in values]
    magnitudes = [
        (low, high) if figure.value >= 0.0 else (-high, -low) for figure, (low, high) in zip(values, ends, strict=True)
    ]
    tail = 1.0 - (1.0 - TAIL) ** (1.0 / len(values))
    inner = max(_lower(value, low, tail) for value, (low, _) in zip(values, magnitudes, strict=True))
    outer = max(high for _, high in magnitudes)
    if inner >= 0.0:
        return (inner, outer) if sign > 0.0 else (-outer, -inner)
    hull = min(low for low, _ in ends), max(high for _, high in ends)
    interval = (inner, outer) if sign > 0.0 else (-outer, -inner)
    return min(hull[0], interval[0]), max(hull[1], interval[1])


def _ends(figure: FigureValue) -> tuple[float, float]:
    """The 95 % interval of one axis; that of a normal law where none is stated."""
    reach = REACH_95 * figure.uncertainty
    low = figure.low if not np.isnan(figure.low) else figure.value - reach
    high = figure.high if not np.isnan(figure.high) else figure.value + reach
    return low, high


def _lower(value: FigureValue, low: float, tail: float) -> float:
    """Lower end of a magnitude with a smaller tail than that of its interval of 95 %."""
    if np.isfinite(value.dof):
        return DeviationLaw(value.value, value.dof, value.removed).quantile(tail)
    return abs(value.value) - (abs(value.value) - low) * float(normal_upper(tail)) / REACH_95


MINUS = "−"
SMALLEST_FIXED, LARGEST_FIXED = 1e-5, 1e8  # of U in fixed notation


def with_uncertainty(value: float, expanded: float) -> str:
    """``value ± U``, U to two digits and the value to the same decimal (GUM 7.2.6)."""
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
    for missed in diagnosis.classes:
        effect, *rivals = missed.effects
        alike = f"; {by} do not separate it from {', '.join(rivals)}" if rivals else ""
        out.append(("missing effect", f"{effect}: {size(effect)}, {probability(missed.p_value)}{alike}"))
    if diagnosis.classes:
        held = " → ".join(f"{value:.2f}" for value in diagnosis.left_out)
        text = f"rms residual {before} → {after} {unit}; {left_out} left out, in standard uncertainties: {held}"
        out.append(("with the missing effects", text))
    if diagnosis.unexplained:
        out.append(("unexplained", f"no known effect explains {unexplained}"))
    return [*out, *(("next measurement", step) for step in diagnosis.next_steps)]


def signed(value: float, places: int) -> str:
    """A difference with its sign to some decimals; a difference that rounds to zero has no sign."""
    shown = round(value, places)
    text = f"{shown:+.{places}f}" if shown else f"{0.0:.{places}f}"
    return text.replace("-", MINUS)


def probability(p: float) -> str:
    """A probability with its sign: ``p = 0.68``, ``p < 0.001``."""
    return f"p {equal(p)}"
