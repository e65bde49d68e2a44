"""Results by comparison (sweep, random vibration, transverse, shock) that can be certified, and the reasons why others cannot."""

from typing import Any

import numpy as np
import pandas as pd

from inertial.probability import passes
from inertial.uncertainty.rounding import equal
from pipelines.archive import Run
from pipelines.procedures import PROCEDURES, parts_of
from pipelines.procedures.base import Compares
from pipelines.stages.uncertainty.budget_terms import BudgetTerms, archived_terms
from pipelines.stages.uncertainty.compared import missing_terms
from pipelines.tables.frames import rows_of
from schemas.comparison import TERMS
from schemas.limits import ADEQUACY_P_MIN
from schemas.recipe import Recipe
from schemas.tables import ADEQUATE, NOT_JUDGED

TABLES = ("procedure_results", "procedure_curves", "procedure_points", "uncertainties")
"""The tables that support a certificate of comparisons."""


class Comparisons:
    """The results by comparison of a captured run, and whether they can be certified for each unit.

    Parameters
    ----------
    run : the run; one from a version without comparisons has none
    """

    def __init__(self, run: Run) -> None:
        about = run.about
        known = bool(about.get("capture")) and {*TABLES} <= {*run.tables()}
        listed = (about.get("recipe") or {}).get("procedures") or []
        self.parts: dict[int, Any] = {}
        if known and any(isinstance(PROCEDURES.get(str(procedure.get("kind"))), Compares) for procedure in listed):
            parts = enumerate(parts_of(Recipe.model_validate(about["recipe"])))
            self.parts = {number: part for number, part in parts if isinstance(PROCEDURES[part.kind], Compares)}
        self._run, self._terms = run, archived_terms(about)
        limits = about.get("limits") or {}
        self._tables: dict[str, dict[str, pd.DataFrame]] = {}
        self._least = float(limits.get("adequacy_p_min") or ADEQUACY_P_MIN)

    def results(self, unit: str) -> dict[int, pd.DataFrame]:
        """The results of a unit that can be certified, rows of ``procedure_results`` by the number of the procedure."""
        return {
            number: self._of("procedure_results", unit, number) for number, why in self.reasons(unit).items() if not why
        }

    def reasons(self, unit: str) -> dict[int, str]:
        """The reason why the results of each comparison cannot be certified, by its number; an empty text if they can."""
        return {number: self._reason(unit, number, part) for number, part in self.parts.items()}

    def verdicts(self, unit: str) -> str:
        """The verdicts on the models behind the certified results, in one line."""
        lines: list[str] = []
        for number in self.results(unit):
            for row in self._models(unit, number):
                p = float(row["p_value"])
                lines.append(
                    f"{self._name(number)}: {row['verdict'].upper()}{f' (p {equal(p)})' if np.isfinite(p) else ''}"
                )
        return "; ".join(lines)

    def _of(self, table: str, unit: str, number: int) -> pd.DataFrame:
        if table not in self._tables:  # grouped once, because each unit of a large lot gets a certificate
            self._tables[table] = {str(name): rows for name, rows in self._run.table(table).groupby("unit", sort=False)}
        rows = self._tables[table].get(unit)
        return pd.DataFrame() if rows is None else rows[rows["number"] == number]

    def _models(self, unit: str, number: int) -> list[dict[str, Any]]:
        rows = self._of("procedure_curves", unit, number)
        return rows_of(rows.drop_duplicates("axis")) if len(rows) else []

    def _name(self, number: int) -> str:
        kind = self.parts[number].kind
        twice = sum(part.kind == kind for part in self.parts.values()) > 1
        return f"{kind} (procedure {number + 1})" if twice else str(kind)

    def _reason(self, unit: str, number: int, part: Any) -> str:
        rows, name = self._of("procedure_results", unit, number), self._name(number)
        if rows.empty:
            notes = [row["note"] for row in rows_of(self._of("procedure_figures", unit, number)) if row["note"]]
            return f"{name}: its points are not determined: {notes[0] if notes else 'no record gives a value'}"
        if self._terms is None or self._terms.stated is None:
            return f"{name}: no uncertainty of the {rows['role'].iloc[0]} is stated; add [uncertainty] to the station's file"
        if why := _unstated(rows, self._terms):
            return f"{name}: {why}"
        for row in self._models(unit, number):
            p = float(row["p_value"])
            if row["verdict"] == NOT_JUDGED and row["model"] != "sine over the angle":
                again = "measure again" if part.kind == "shock" else "measure more frequencies"
                return f"{name}: the model {row['model']} cannot be judged ({row['reason']}); {again}"
            if row["verdict"] != ADEQUATE and (row["reason"] or not passes(p, self._least)):
                lacks = f", {row['reason']}: name it in effects of the recipe" if row["reason"] else ""
                return f"{name}: the model {row['model']} is NOT ADEQUATE (p {equal(p)}){lacks}"
        return self._reference_understated(part, name, rows)

    def _reference_understated(self, part: Any, name: str, rows: pd.DataFrame) -> str:
        """A refusal if limited figures use a reference_percent of the recipe below the station's uncertainty; else empty."""
        figures = {figure.name for figure in PROCEDURES[part.kind].figures}
        limited = figures & {*((self._run.about.get("limits") or {}).get("figures") or {})}
        stated = getattr(part, "reference_percent", None)
        terms = self._terms
        known = (
            None
            if terms is None or terms.stated is None
            else terms.stated.comparison(str(rows["role"].iloc[0]), np.nan)
        )
        if stated is None or known is None or not limited:
            return ""
        needed = 100.0 * float(np.linalg.norm([known.entries[entry].standard().u for entry in ("reference", "drift")]))
        if needed <= stated * (1.0 + 1e-9):
            return ""
        return (
            f"{name}: figures were decided with reference_percent {stated:g}, the station states {needed:.3g} % for its "
            "reference sensor and drift; state at least that in the recipe"
        )


def _unstated(rows: pd.DataFrame, terms: BudgetTerms) -> str:
    """A text with the terms that the results need and the station does not state, and their frequencies; else empty."""
    missing: dict[str, list[float]] = {}
    for row in rows_of(rows):
        for name in missing_terms(row, terms):
            missing.setdefault(name, []).append(float(row["setting"]))
    if not missing:
        return ""
    role = str(rows["role"].iloc[0])
    settings = [at for missing_at in missing.values() for at in missing_at if np.isfinite(at)]
    where = f" at {min(settings):.4g} to {max(settings):.4g} Hz" if settings else ""
    named = ", ".join(sorted(missing, key=TERMS.index))
    return (
        f"not stated: {named} of [uncertainty] {role}{where}, a certificate needs it (a 0 needs exact = true); "
        "add it to the station's file and measure again"
    )
