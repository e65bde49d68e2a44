"""Findings about the population: outliers, low capability, and differences between groups."""

from __future__ import annotations

from collections.abc import Iterator

from inertial.counts import number_of
from inertial.uncertainty.rounding import equal
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import date_of
from pipelines.audit.finding import AuditFinding
from pipelines.audit.parameters import unit_text
from pipelines.audit.population import Ability
from pipelines.report.numbers import significant

TELLING_EFFECT = 0.02  # smaller shares of the variance between groups are not relevant
DIFFERENT_P = 1e-3


def of_population(audit: Audit) -> Iterator[AuditFinding]:
    """All findings about the population, outliers first."""
    yield from _odd(audit)
    yield from _incapable(audit)
    yield from _different(audit)


def _odd(audit: Audit) -> Iterator[AuditFinding]:
    for odd in audit.odd:
        what = f"lot of run {odd.run} ({number_of(odd.units, 'unit')})" if odd.kind == "lot" else f"unit {odd.name}"
        text = unit_text(odd.parameter)
        message = (
            f"{odd.device}: {what} of {date_of(odd.day)} is an outlier in {odd.parameter}: {significant(odd.value, 4)} {text}, "
            f"{odd.z:+.1f} σ from its kind; look for a change in its production"
        )
        evidence = {"run": odd.run, "station": odd.station, "parameter": odd.parameter, "value": odd.value, "z": odd.z}
        yield AuditFinding(
            "product", f"odd_{odd.kind}", odd.name, message, (odd.name,) if odd.kind == "unit" else (), evidence
        )


def _incapable(audit: Audit) -> Iterator[AuditFinding]:
    for able in audit.abilities:
        if able.ppk.low < audit.rules.ppk_least:
            message = (
                f"{able.device}: {able.figure} has Ppk {able.ppk.value:.2f} ({able.ppk.low:.2f} to {able.ppk.high:.2f}) "
                f"against {_limit(able)}, at least {audit.rules.ppk_least:g} is needed; "
                f"{100 * able.outside.value:.2g} % are outside: reduce the spread, or widen the limit"
            )
            evidence = {
                "figure": able.figure,
                "ppk": able.ppk.value,
                "low": able.ppk.low,
                "high": able.ppk.high,
                "n": able.n,
            }
            yield AuditFinding("product", "capability", able.device, message, (), evidence)


def _different(audit: Audit) -> Iterator[AuditFinding]:
    for one in audit.differences:
        if one.by != "lot" and one.p < DIFFERENT_P and one.comparison.effect > TELLING_EFFECT:
            message = (
                f"{one.device}: {one.figure} differs between {one.by}s: {100 * one.comparison.effect:.0f} % of its variance, "
                f"p {equal(one.p)} over {one.comparison.groups} {one.by}s; find out which, and why"
            )
            who = "station" if one.by in {"station", "slot"} else "product"
            evidence = {"figure": one.figure, "by": one.by, "share": one.comparison.effect, "p_value": one.p}
            yield AuditFinding(who, f"differs_by_{one.by}", one.device, message, (), evidence)


def _limit(able: Ability) -> str:
    return f"{able.limit:g}" if able.unit_text == "1" else f"{able.limit:g} {able.unit_text}"
