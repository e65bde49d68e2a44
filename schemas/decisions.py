"""Decisions on figures by the rule of the limits, and the grades by the bias that is left."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan, log
from statistics import NormalDist
from typing import Literal, Protocol

from schemas.limits import LARGEST_PFA, Limits

Outcome = Literal["pass", "conditional pass", "conditional fail", "fail"]


class Law(Protocol):
    """What is known of a figure that is far from normal, a standard deviation of few degrees of freedom."""

    @property
    def dof(self) -> float:
        """Degrees of freedom."""
        ...

    def beyond(self, limit: float) -> float:
        """Probability that the figure exceeds a limit."""
        ...

    def threshold(self, limit: float, guard: float) -> float:
        """The value at which the figure exceeds the limit with the probability 1 − Φ(guard)."""
        ...


# The notes give the grades by the bias that is left: consumer to 1000 µg, industrial to 200 µg, navigation under 50 µg.
GRADES: Mapping[str, float] = {"navigation": 50.0, "industrial": 200.0, "consumer": 1000.0}
GRADE_FIGURE = "bias_error_ug"
PERIOD_FIGURE = "bias_error_period_ug"
"""The figure that a grade rests on where it is known: the 95 % bound of the largest error over the period of validity."""
LARGEST_ERROR, MEDIAN, BOUND = "bias_error_largest", "median", "95 %"
"""The quantity of a budget that it is read from, and the names of its quantiles, at the place of an axis."""
BOUND_SHARE = 0.95
"""Probability of a figure that is a bound: the error stays below it."""


@dataclass(frozen=True)
class Decision:
    """What a rule says of one figure of one unit."""

    figure: str
    value: float
    uncertainty: float
    limit: float
    unit: str
    rule: str
    outcome: Outcome
    risk: float = 0.0
    accept: float = float("nan")
    least: bool = False
    """Whether ``limit`` is the least value that the figure may have."""

    @property
    def pfa(self) -> float:
        """Probability of false acceptance of an accepted unit: that its figure is beyond the limit (JCGM 106, 7.4)."""
        return self.risk if self.passed else 0.0

    @property
    def pfr(self) -> float:
        """Probability of false rejection of a unit that is not accepted: that its figure is within the limit."""
        return 0.0 if self.passed else 1.0 - self.risk

    @property
    def passed(self) -> bool:
        """Whether the unit may be delivered: a conditional pass may not, under a guarded rule."""
        return self.outcome == "pass"

    @property
    def margin(self) -> float:
        """Distance of the figure from the limit, in the figure's unit: negative where the limit is broken."""
        return self.value - self.limit if self.least else self.limit - abs(self.value)

    @property
    def sentence(self) -> str:
        """The decision for people: figure, value, uncertainty, limit and margin."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        what = beside_limit(self.value, self.uncertainty, self.limit, unit, "at least " if self.least else "")
        if self.outcome.startswith("conditional"):
            risk = f"probability of {'falling below' if self.least else 'exceeding'} it {100.0 * self.risk:.2g} %"
            beyond = "below" if self.least else "above"
            where = (
                "inside the guard band" if self.margin >= 0.0 else f"{beyond} the limit by less than its uncertainty"
            )
            remedy = "measure longer, or again"
            if self.uncertainty > self.limit and not self.least:
                remedy = "the uncertainty exceeds the limit, lower its largest contribution"
            return f"{self.figure} not accepted: {where}, {what}, {risk}: {remedy}"
        return f"{self.figure} {self.outcome}: {what}, margin {self.margin:.3g}{unit}"


def digits_beside(value: float, limit: float, digits: int = 3) -> int:
    """Significant digits with which a figure shows on which side of its limit it lies.

    They reach to the last digit of the limit; of a limit itself (``value`` equal to it) they are all its digits.
    """
    step = 10.0 ** -len(f"{limit:.10g}".partition(".")[2].partition("e")[0])
    for count in range(digits, 16):
        shown = float(f"{value:.{count}g}")
        hidden = (abs(shown) - limit) * (abs(value) - limit) <= 0.0 and abs(value) != limit
        if not (abs(shown - value) > 0.5 * step or hidden):  # of a value or limit that is not finite at once
            return count
    return 15


def beside_limit(value: float, uncertainty: float, limit: float, unit: str, side: str = "") -> str:
    """A figure with its uncertainty and its limit, in so many digits that the decision shows."""
    shown = float(f"{value:.{digits_beside(value, limit)}g}")
    spread = f" ± {float(f'{uncertainty:.2g}'):g}" if uncertainty > 0.0 else ""
    return f"{shown:.15g}{spread}{unit}, limit {side}{limit:.10g}{unit}"


def decide(
    limits: Limits,
    figure: str,
    value: float,
    standard_uncertainty: float,
    law: Law | None = None,
    median: float = float("nan"),
) -> Decision:
    """The decision on a figure by the limits' rule.

    Parameters
    ----------
    figure : a key of ``limits.figures``.
    value, standard_uncertainty : in the figure's unit; the rule's coverage factor is applied here.
    law : of the figure where it is not normal; the guard band then ends where the risk is that of the normal one.
    median : of a figure that is a 95 % bound; it passes where the probability of more than the limit is within the rule's, 5 %
        where that states none
    """
    if not isnan(median):
        return _decide_bound(limits, figure, value, median)
    guard = limits.guard_factor * standard_uncertainty
    expanded = limits.coverage_factor * standard_uncertainty
    figure_limit = limits.figures[figure]
    least = figure_limit.min is not None
    limit = figure_limit.min or figure_limit.max or 0.0  # a limit has either of them
    if law is None:
        inner, outer = limit - guard, limit + guard
        risk = (below if least else outside)(value, standard_uncertainty, limit)
        rule = describe_rule(limits)
    else:
        inner, outer = (law.threshold(limit, sign * limits.guard_factor) for sign in (1.0, -1.0))
        risk = 1.0 - law.beyond(limit) if least else law.beyond(limit)
        rule = f"{describe_rule(limits)}; standard deviation: risk and guard band by χ² with {law.dof:.3g} degrees of freedom"
    return Decision(
        figure=figure,
        value=value,
        uncertainty=expanded,
        limit=limit,
        unit=figure_limit.unit,
        rule=rule,
        outcome=_outcome(-value, -limit, (-outer, -inner)) if least else _outcome(abs(value), limit, (inner, outer)),
        risk=risk,
        accept=outer if least else inner,
        least=least,
    )


def _decide_bound(limits: Limits, figure: str, bound: float, median: float) -> Decision:
    limit = limits.figures[figure].max or 0.0
    risk = exceedance(median, bound, limit)
    allowed = (limits.pfa_max or LARGEST_PFA) if limits.rule == "allowed_pfa" else 1.0 - BOUND_SHARE
    accept, unit = limit if limits.rule != "allowed_pfa" else float("nan"), limits.figures[figure].unit
    outcome: Outcome = "pass" if risk <= allowed else "fail"
    return Decision(figure, bound, 0.0, limit, unit, describe_rule(limits), outcome, risk, accept)


def exceedance(median: float, bound: float, limit: float) -> float:
    """Probability that an error with this median and 95 % bound exceeds a limit.

    Its logarithm is taken as normal: of the root of a sum of squares, whose tail is Gaussian, this states more than is met beyond
    the bound.
    """
    if not (median > 0.0 and bound > median and limit > 0.0):
        return float(not bound <= limit)
    score = NormalDist().inv_cdf(BOUND_SHARE) * log(limit / median) / log(bound / median)
    return NormalDist().cdf(-score)


def outside(value: float, u: float, limit: float) -> float:
    """Probability that a figure measured as ``value`` with standard uncertainty ``u`` lies beyond ± limit (JCGM 106, 7.4)."""
    if not u > 0.0:
        return float(not abs(value) <= limit)
    normal = NormalDist()
    return normal.cdf((-limit - value) / u) + normal.cdf((value - limit) / u)


def below(value: float, u: float, least: float) -> float:
    """Probability that a figure measured as ``value`` with standard uncertainty ``u`` lies below its least value."""
    return NormalDist().cdf((least - value) / u) if u > 0.0 else float(not value >= least)


def _outcome(magnitude: float, limit: float, guard_band: tuple[float, float]) -> Outcome:
    if magnitude <= guard_band[0]:
        return "pass"
    if magnitude > guard_band[1]:
        return "fail"
    return "conditional pass" if magnitude <= limit else "conditional fail"


def describe_rule(limits: Limits) -> str:
    """The decision rule in the words that stand beside every result."""
    if limits.rule == "simple_acceptance":
        return f"ILAC-G8:09/2019 simple acceptance, U with k = {limits.coverage_factor:g}"
    if limits.rule == "allowed_pfa":
        allowed = 100.0 * (limits.pfa_max or LARGEST_PFA)
        return (
            f"JCGM 106:2012 guard band {limits.guard_factor:.3f}·u, probability of false acceptance at most {allowed:g} %, "
            f"U with k = {limits.coverage_factor:g}"
        )
    return f"ILAC-G8:09/2019 guarded acceptance, w = U with k = {limits.coverage_factor:g}"


def grade_with(value_ug: float, guard_ug: float) -> str | None:
    """The best grade whose bias limit accepts the value with a guard band; None where not even the lowest does."""
    return next((name for name, limit in GRADES.items() if abs(value_ug) <= limit - guard_ug), None)
