"""Conformity decisions: every figure of every unit against its limit under the agreed rule, the grade, and the reasons."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.procedures import PROCEDURES, figures_of_recipe
from pipelines.stages.figures import FIGURES, Figure, figures_of
from pipelines.stages.figures.base import BudgetRow, LotCoefficients, UnitTables, Value
from pipelines.stages.uncertainty.decision_budget import DecisionBudget
from pipelines.stages.uncertainty.lot_risks import lot_risks
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.frames import ByUnit, empty_table
from schemas.decisions import (
    GRADE_FIGURE,
    GRADES,
    PERIOD_FIGURE,
    Decision,
    decide,
    describe_rule,
    exceedance,
    grade_with,
)
from schemas.errors import RecipeInvalid
from schemas.limits import Limits
from schemas.recipe import Recipe

NO_GRADE = "none"
FIGURE_TEXTS, FIGURE_NUMBERS = "unit figure unit_text outcome rule", "value uncertainty limit accept pfa pfr"


NOISE_ONLY, BUDGET = "noise only", "budget"
BEST_OF_NOISE = "consumer"
"""The best grade that a run without a stated uncertainty may have."""


@dataclass(frozen=True)
class GradeEvidence:
    """The tables that a decision is based on.

    uncertainties, budget_covariance : tables of the uncertainty budget; None, or without rows, if no uncertainty is stated
    full_scale : largest excursion of the output from 0 g by unit, output unit
    calibration : coefficients with their covariance, if other stages have read them already
    budget : the uncertainty budget instead of its two tables, if these are not made
    """

    verdicts: pd.DataFrame
    coefficients: pd.DataFrame
    covariance: pd.DataFrame
    residuals: pd.DataFrame
    verification: pd.DataFrame
    verification_poses: pd.DataFrame
    noise: pd.DataFrame
    uncertainties: pd.DataFrame | None = None
    budget_covariance: pd.DataFrame | None = None
    procedure_figures: pd.DataFrame | None = None
    full_scale: Mapping[str, float] = field(default_factory=dict[str, float])
    calibration: Calibration | None = None
    budget: DecisionBudget | None = None

    @property
    def basis(self) -> str:
        """The basis of the uncertainties: the budget, or noise only."""
        if self.budget is not None:
            return BUDGET
        return NOISE_ONLY if self.uncertainties is None or self.uncertainties.empty else BUDGET


def refuse_limits_without_figures(limits: Limits, recipe: Recipe) -> None:
    """Refuse limits on figures that the recipe cannot yield, all in one message, before anything is measured."""
    lacking: dict[str, list[str]] = {}
    for name in limits.figures:
        if missing := _missing(name, recipe):
            lacking.setdefault(missing, []).append(name)
    if lacking:
        listed = "; ".join(
            f"{', '.join(names)} {'needs' if len(names) == 1 else 'need'} {missing}"
            for missing, names in lacking.items()
        )
        raise RecipeInvalid(
            f"limits {limits.name}: {listed}, the recipe has none; add it, or drop the limit",
            key=f"figures.{next(iter(lacking.values()))[0]}",
        )


def _missing(figure: str, recipe: Recipe) -> str:
    """The part of a recipe that is missing for a figure; empty if the recipe yields the figure."""
    if figure in FIGURES:
        return FIGURES[figure].missing(recipe) if recipe.tumbles else "procedure multi_position"
    if figure in figures_of_recipe(recipe):
        return ""
    owner = next(name for name, one in PROCEDURES.items() if figure in {spec.name for spec in one.figures})
    return f"procedure {owner}"


def grade(
    evidence: GradeEvidence, limits: Limits, zero_g: float = 0.0, *, tumbles: bool = True, figures: bool = True
) -> dict[str, pd.DataFrame]:
    """Tables ``figures`` (one row per unit and figure), ``grades`` (one row per unit) and ``lot_risks`` (one per limited figure).

    With an uncertainty budget the grade is based on the error expected over the period of validity, if known; without a budget no
    unit gets a grade above consumer.

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit
    tumbles : whether the recipe has the multi-position test; without it units have no coefficients and are not refused for that
    figures : whether to make the tables ``figures`` and ``lot_risks``, which no decision depends on
    """
    rule = describe_rule(limits)
    guard = limits.guard_factor
    budget_of = _budget(evidence)
    coefficients, places = _coefficients(evidence, zero_g)
    residuals, verification, verification_poses, noise = map(
        ByUnit, (evidence.residuals, evidence.verification, evidence.verification_poses, evidence.noise)
    )
    figure_rows: list[dict[str, object]] = []
    grade_rows: list[dict[str, object]] = []
    squares: dict[str, list[float]] = {}
    for verdict in evidence.verdicts.to_dict("records"):
        unit = str(verdict["unit"])
        if verdict["refused"] or (coefficients is None and tumbles):
            grade_rows.append(_grade_row(verdict, "refused", NO_GRADE, str(verdict["reason"])))
            continue
        own_figures: list[Figure] = []
        if coefficients is not None:
            tables = UnitTables(
                residuals.of(unit),
                verification.of(unit),
                verification_poses.of(unit),
                noise.of(unit),
                coefficients.of(places[unit]),
                guard,
                budget_of(unit),
                evidence.full_scale.get(unit, float("nan")),
            )
            own_figures += figures_of(tables)
        own_figures += _of_procedures(evidence.procedure_figures, unit, limits)
        decisions = [
            decide(limits, f.name, f.of.value, f.of.uncertainty, f.of.law, f.of.median)
            for f in own_figures
            if f.name in limits.figures and not f.of.why_not
        ]
        if figures:
            figure_rows += [
                _figure_row(unit, figure, decisions, limits) for figure in own_figures if not figure.of.why_not
            ]
            for figure in own_figures:
                squares.setdefault(figure.name, []).append(figure.of.shared**2)
        grade_rows.append(_decided(verdict, own_figures, decisions, limits, evidence.basis))
    grades = _table(grade_rows).assign(rule=rule, basis=evidence.basis)
    if not figures:
        return {"grades": grades}
    shared = {name: float(np.sqrt(np.mean(variances))) for name, variances in squares.items()}
    figure_table = _table(figure_rows) if figure_rows else empty_table(texts=FIGURE_TEXTS, numbers=FIGURE_NUMBERS)
    return {
        "figures": figure_table,
        "grades": grades,
        "lot_risks": lot_risks(figure_table, limits, shared),
    }


def _budget(evidence: GradeEvidence) -> Callable[[str], Mapping[tuple[str, str], BudgetRow]]:
    """A function from a unit to the rows of its budget, by quantity and axis."""
    if evidence.budget is not None:
        return evidence.budget.of
    by_unit: dict[str, dict[tuple[str, str], BudgetRow]] = {}
    table = evidence.uncertainties
    if table is None:
        return lambda _unit: {}
    columns = (table[name].tolist() for name in ("unit", "quantity", "axis", "value", "u_a", "u_b", "u"))
    for unit, quantity, axis, *numbers in zip(*columns, strict=True):
        by_unit.setdefault(str(unit), {})[str(quantity), str(axis)] = BudgetRow(*numbers)
    return lambda unit: by_unit.get(unit, {})


def _stated(table: pd.DataFrame | None, units: int) -> Array | None:
    """Covariance of the coefficients by the budget, (units, 3p, 3p)."""
    if table is None or table.empty:
        return None
    size = int(table["row"].max()) + 1
    out = np.zeros((units, size, size))
    row, column = np.tril_indices(size)
    values = table["value"].to_numpy().reshape(units, -1)
    out[:, row, column] = values
    out[:, column, row] = values
    return out


def _of_procedures(table: pd.DataFrame | None, unit: str, limits: Limits) -> list[Figure]:
    """The figures of a unit from procedures; of several axes, or of repeated procedures, the one closest to its limit."""
    figures: dict[str, Figure] = {}
    if table is None or table.empty:
        return []
    guard = limits.coverage_factor if limits.rule == "guarded_acceptance" else 0.0
    for row in table[table["unit"] == unit].to_dict("records"):
        why = "" if row["identified"] else f"axis {row['axis']}: {row['note']}"
        value = float(row["value"]) if row["identified"] else np.inf
        name = str(row["figure"])
        # runs of earlier versions lack these columns
        dof, removed = float(row.get("dof", np.nan)), float(row.get("removed", 0.0))
        error = float(row["uncertainty"]) if not why else 0.0
        figure = Figure(name, str(row["unit_text"]), Value(value, error, why, dof=dof, removed=removed))
        before = figures.get(name)
        least = name in limits.figures and limits.figures[name].min is not None
        if before is None or _badness(figure.of, guard, least=least) > _badness(before.of, guard, least=least):
            figures[name] = figure
    return list(figures.values())


def _badness(figure: Value, guard: float, *, least: bool) -> float:
    """Figure plus guard band in the direction of its limit, for comparison; infinite if not determined or not a number."""
    if figure.why_not:
        return float("inf")
    badness = (-figure.value if least else abs(figure.value)) + guard * figure.uncertainty
    return badness if np.isfinite(badness) else float("inf")


def _coefficients(evidence: GradeEvidence, zero_g: float) -> tuple[LotCoefficients | None, dict[str, int]]:
    """The coefficients of the lot and the index of each unit in them; None where no unit was calibrated."""
    if evidence.coefficients.empty:
        return None, {}
    calibration = evidence.calibration or read_calibration(evidence.coefficients, evidence.covariance)
    units = len(calibration.units)
    stated = _stated(evidence.budget_covariance, units) if evidence.budget is None else evidence.budget.covariance
    return LotCoefficients(calibration, zero_g, stated), {unit: index for index, unit in enumerate(calibration.units)}


def _table(rows: list[dict[str, object]]) -> pd.DataFrame:
    return pd.DataFrame({name: [row[name] for row in rows] for name in (rows[0] if rows else ())})


def _decided(
    verdict: dict, figures: list[Figure], decisions: list[Decision], limits: Limits, basis: str
) -> dict[str, object]:
    """The row of the table ``grades`` of a unit: outcome, grade, its risk, and the reasons of a failure."""
    best, risk = NO_GRADE, float("nan")
    reasons = [decision.sentence for decision in decisions if not decision.passed]
    reasons += [
        f"{figure.name}: not determined ({figure.of.why_not}), limit {limits.figures[figure.name].text}"
        for figure in figures
        if figure.of.why_not and figure.name in limits.figures
    ]
    by_name = {figure.name: figure for figure in figures}
    figure = by_name.get(PERIOD_FIGURE, by_name.get(GRADE_FIGURE))
    if figure is not None:
        known = figure.name == PERIOD_FIGURE
        best = grade_with(figure.of.value, limits.guard_factor * figure.of.uncertainty) or NO_GRADE
        if known and best in GRADES:
            risk = exceedance(figure.of.median, figure.of.value, GRADES[best])
        if not known and _good_enough(best, BEST_OF_NOISE):
            best = BEST_OF_NOISE
        if limits.grade != NO_GRADE and not _good_enough(best, limits.grade):
            reasons.append(f"grade reached: {best}{_why(figure, best, basis)}, grade required: {limits.grade}")
    return _grade_row(verdict, "fail" if reasons else "pass", best, "; ".join(reasons), risk)


def _why(figure: Figure, best: str, basis: str) -> str:
    """The reason why a grade is not higher, in brackets; empty if there is none."""
    if figure.name == PERIOD_FIGURE:
        return f" (95 % bound of the largest error over the period of validity {float(f'{figure.of.value:.3g}'):g} µg)"
    if best != BEST_OF_NOISE:
        return ""
    if basis == NOISE_ONLY:
        return " (noise only: no [uncertainty] is stated, no grade above consumer)"
    return " (the error over the period of validity is unknown: state [stability] of the device)"


def _good_enough(grade: str, required: str) -> bool:
    order = list(GRADES)
    return grade in order and order.index(grade) <= order.index(required)


def _grade_row(verdict: dict, outcome: str, best: str, reasons: str, risk: float = float("nan")) -> dict[str, object]:
    """A row of the table ``grades``; ``grade_risk``: probability that any axis exceeds the limit of the grade."""
    return {
        "unit": str(verdict["unit"]),
        "slot": int(verdict["slot"]),
        "outcome": outcome,
        "grade": best,
        "grade_risk": risk,
        "reasons": reasons,
    }


def _figure_row(unit: str, figure: Figure, decisions: list[Decision], limits: Limits) -> dict[str, object]:
    decision = next((d for d in decisions if d.figure == figure.name), None)
    has_least = any(limit.min is not None for limit in limits.figures.values())  # ``limit`` is an upper limit
    return {
        "unit": unit,
        "figure": figure.name,
        "value": figure.of.value,
        "uncertainty": limits.coverage_factor * figure.of.uncertainty,
        "limit": decision.limit if decision and not decision.least else np.nan,
        "unit_text": figure.unit,
        "outcome": decision.outcome if decision else "no limit",
        "rule": decision.rule if decision else "",
        "accept": decision.accept if decision else np.nan,
        "pfa": decision.pfa if decision else np.nan,
        "pfr": decision.pfr if decision else np.nan,
        **({"least": decision.limit if decision and decision.least else np.nan} if has_least else {}),
    }
