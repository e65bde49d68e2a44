"""Decisions: every figure of every unit against its limit under the agreed rule, the grade, and the reasons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from pipelines.procedures import PROCEDURES, figures_of_recipe
from pipelines.stages.figures import FIGURES, Figure, LotCoefficients, UnitTables, figures_of
from pipelines.tables.calibration import read_calibration
from pipelines.tables.frames import ByUnit, empty_table
from schemas.errors import RecipeInvalid
from schemas.limits import GRADE_FIGURE, GRADES, Decision, Limits, decide, describe_rule, grade_of

if TYPE_CHECKING:
    from schemas.recipe import Recipe

NO_GRADE = "none"
FIGURE_TEXTS, FIGURE_NUMBERS = "unit figure unit_text outcome rule", "value uncertainty limit"


@dataclass(frozen=True)
class Evidence:
    """The tables that a decision rests on."""

    verdicts: pd.DataFrame
    coefficients: pd.DataFrame
    covariance: pd.DataFrame
    residuals: pd.DataFrame
    verification: pd.DataFrame
    verification_poses: pd.DataFrame
    noise: pd.DataFrame
    procedure_figures: pd.DataFrame | None = None


def refuse_limits_without_figures(limits: Limits, recipe: Recipe) -> None:
    """Refuse limits on figures that the recipe cannot yield, before anything is measured."""
    for name in limits.figures:
        if name in FIGURES:
            missing = FIGURES[name].missing(recipe) if recipe.tumbles else "procedure multi_position"
        elif name in figures_of_recipe(recipe):
            missing = ""
        else:
            owner = next(one.name for one in PROCEDURES.values() if name in {figure.name for figure in one.figures})
            missing = f"procedure {owner}"
        if missing:
            raise RecipeInvalid(
                f"limits {limits.name}: {name} needs {missing}, the recipe has none; add it, or drop the limit",
                key=f"figures.{name}",
            )


def grade(evidence: Evidence, limits: Limits, zero_g: float = 0.0, *, tumbles: bool = True) -> dict[str, pd.DataFrame]:
    """Tables ``figures`` (one row per unit and figure) and ``grades`` (one row per unit).

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit.
    tumbles : whether the recipe has the multi-position test; without it a unit has no coefficients, and is not refused for that
    """
    rule = describe_rule(limits)
    guard = limits.coverage_factor if limits.rule == "guarded_acceptance" else 0.0
    coefficients, places = _coefficients(evidence, zero_g)
    residuals, verification, verification_poses, noise = map(
        ByUnit, (evidence.residuals, evidence.verification, evidence.verification_poses, evidence.noise)
    )
    figure_rows: list[dict[str, object]] = []
    grade_rows: list[dict[str, object]] = []
    for verdict in evidence.verdicts.to_dict("records"):
        unit = str(verdict["unit"])
        if verdict["refused"] or (coefficients is None and tumbles):
            grade_rows.append(_grade_row(verdict, "refused", NO_GRADE, str(verdict["reason"])))
            continue
        figures: list[Figure] = []
        if coefficients is not None:
            own = UnitTables(
                residuals.of(unit),
                verification.of(unit),
                verification_poses.of(unit),
                noise.of(unit),
                coefficients.of(places[unit]),
                guard,
            )
            figures += figures_of(own)
        figures += _of_procedures(evidence.procedure_figures, unit, limits)
        decisions = [
            decide(limits, f.name, f.value, f.uncertainty)
            for f in figures
            if f.name in limits.figures and not f.why_not
        ]
        figure_rows += [_figure_row(unit, figure, decisions, limits) for figure in figures if not figure.why_not]
        grade_rows.append(_decided(verdict, figures, decisions, limits))
    return {
        "figures": _table(figure_rows) if figure_rows else empty_table(texts=FIGURE_TEXTS, numbers=FIGURE_NUMBERS),
        "grades": _table(grade_rows).assign(rule=rule),
    }


def _of_procedures(table: pd.DataFrame | None, unit: str, limits: Limits) -> list[Figure]:
    """The figures of a unit that procedures have determined; of several axes, or repeated procedures, the largest."""
    found: dict[str, Figure] = {}
    if table is None or table.empty:
        return []
    guard = limits.coverage_factor if limits.rule == "guarded_acceptance" else 0.0
    for row in table[table["unit"] == unit].to_dict("records"):
        why = "" if row["identified"] else f"axis {row['axis']}: {row['note']}"
        value = float(row["value"]) if row["identified"] else np.inf
        name = str(row["figure"])
        one = Figure(name, str(row["unit_text"]), value, float(row["uncertainty"]) if not why else 0.0, why)
        before = found.get(name)
        nearer = (
            before is None or abs(one.value) + guard * one.uncertainty > abs(before.value) + guard * before.uncertainty
        )
        if nearer:
            found[name] = one
    return list(found.values())


def _coefficients(evidence: Evidence, zero_g: float) -> tuple[LotCoefficients | None, dict[str, int]]:
    """The coefficients of the lot and the place of each unit in them; None where no unit was calibrated."""
    if evidence.coefficients.empty:
        return None, {}
    calibration = read_calibration(evidence.coefficients, evidence.covariance)
    return LotCoefficients(calibration, zero_g), {unit: place for place, unit in enumerate(calibration.units)}


def _table(rows: list[dict[str, object]]) -> pd.DataFrame:
    """Rows that all have the same columns as a table."""
    return pd.DataFrame({name: [row[name] for row in rows] for name in (rows[0] if rows else ())})


def _decided(verdict: dict, figures: list[Figure], decisions: list[Decision], limits: Limits) -> dict[str, object]:
    best = NO_GRADE
    reasons = [decision.sentence for decision in decisions if not decision.passed]
    reasons += [
        f"{figure.name}: not determined ({figure.why_not}), limit {limits.figures[figure.name].max:.4g}"
        for figure in figures
        if figure.why_not and figure.name in limits.figures
    ]
    for figure in figures:
        if figure.name == GRADE_FIGURE:
            best = grade_of(figure.value, limits.coverage_factor * figure.uncertainty, limits.rule) or NO_GRADE
            if not _good_enough(best, limits.grade):
                reasons.append(f"grade {best}: grade {limits.grade} is needed")
    return _grade_row(verdict, "fail" if reasons else "pass", best, "; ".join(reasons))


def _good_enough(grade: str, required: str) -> bool:
    order = list(GRADES)
    return grade in order and order.index(grade) <= order.index(required)


def _grade_row(verdict: dict, outcome: str, best: str, reasons: str) -> dict[str, object]:
    return {
        "unit": str(verdict["unit"]),
        "slot": int(verdict["slot"]),
        "outcome": outcome,
        "grade": best,
        "reasons": reasons,
    }


def _figure_row(unit: str, figure: Figure, decisions: list[Decision], limits: Limits) -> dict[str, object]:
    decision = next((d for d in decisions if d.figure == figure.name), None)
    return {
        "unit": unit,
        "figure": figure.name,
        "value": figure.value,
        "uncertainty": limits.coverage_factor * figure.uncertainty,
        "limit": decision.limit if decision else np.nan,
        "unit_text": figure.unit,
        "outcome": decision.outcome if decision else "no limit",
        "rule": decision.rule if decision else "",
    }
