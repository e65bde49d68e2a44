"""The budget of results by comparison: what records and recipe give, and the terms that the station states of the equipment."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from inertial.uncertainty.degrees import coverage_factors, effective_degrees
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.stages.uncertainty.tables import LABELS, source_of
from pipelines.tables.frames import rows_of
from schemas.comparison import TERMS
from schemas.stated import Entry

OF_RECIPE = {"repeatability": "recipe", "nominal_scale": "recipe, or the calibration of the run"}
LARGEST = 3


def compared_quantity(row: Mapping[str, Any]) -> str:
    """The name of a result of ``procedure_results`` in the tables of the budget: those of a point have its number."""
    point = f".{row['point']}" if row["point"] or str(row["quantity"]).startswith("response_") else ""
    return f"{row['procedure']}.{row['number']}.{row['quantity']}{point}"


def missing_terms(row: Mapping[str, Any], terms: BudgetTerms) -> list[str]:
    """The terms that a result depends on and the statement of its equipment lacks; all where it states none at its frequency."""
    known = _stated(row, terms)
    return [
        name
        for name in TERMS
        if row[f"c_{name}"] != 0.0 and (name not in known or not (known[name].exact or known[name].standard().u > 0.0))
    ]


def compared_tables(results: pd.DataFrame, terms: BudgetTerms) -> dict[str, pd.DataFrame]:
    """Rows of ``budget`` and ``uncertainties`` for results whose equipment has a statement; k for 95.45 % by ν_eff.

    Parameters
    ----------
    results : the table ``procedure_results``
    """
    parts: list[dict[str, Any]] = []
    sums: list[dict[str, Any]] = []
    for row in rows_of(results):
        if terms.stated is None or terms.stated.comparison(row["role"], row["setting"]) is None:
            continue
        about = {
            "unit": row["unit"],
            "quantity": compared_quantity(row),
            "axis": row["axis"],
            "unit_text": row["unit_text"],
        }
        contributions = list(_contributions(row, terms))
        sums.append(about | _sum(row, contributions) | {"frame": terms.certificate.frame, "setting": row["setting"]})
        variance = sum(part["u"] ** 2 for part in contributions)
        parts += [
            about | part | {"share": part["u"] ** 2 / variance if variance > 0.0 else 0.0} for part in contributions
        ]
    return {"budget": pd.DataFrame(parts), "uncertainties": pd.DataFrame(sums)}


def _stated(row: Mapping[str, Any], terms: BudgetTerms) -> dict[str, Entry]:
    comparison = None if terms.stated is None else terms.stated.comparison(row["role"], row["setting"])
    return {} if comparison is None else comparison.entries


def _contributions(row: Mapping[str, Any], terms: BudgetTerms) -> Iterator[dict[str, Any]]:
    """The contributions to one result, without those that are exactly 0."""
    yield _row_of_unit("record_noise", float(row["u_noise"]), "A", float(row["dof"]), "the records of the procedure")
    for name, source in OF_RECIPE.items():
        if row[f"u_{name}"] > 0.0:
            yield _row_of_unit(name, float(row[f"u_{name}"]), "B", float("inf"), source)
    known = _stated(row, terms)
    for name in (name for name in TERMS if row[f"c_{name}"] != 0.0 and name in known):
        entry, sensitivity = known[name], abs(float(row[f"c_{name}"]))
        standard = entry.standard()
        u = sensitivity * standard.u
        # the exciter may move across more than is stated, at a resonance of its fixture: what was measured counts
        measured = float(row["u_transverse"]) if name == "transverse" else 0.0
        if max(u, measured) > 0.0:
            yield {
                "contribution": name, "type": "B", "distribution": standard.distribution, "scope": entry.scope,
                "input_unit": standard.unit, "source": source_of(entry) if u >= measured else "motion as it was measured",
                "u": max(u, measured), "divisor": standard.divisor, "stated": standard.stated,
                "dof": float(entry.dof or np.inf), "visible": float("nan"),
                "sensitivity": u / (standard.stated / standard.divisor) if standard.stated > 0.0 else float("nan"),
            }  # fmt: skip


def _row_of_unit(name: str, u: float, kind: str, dof: float, source: str) -> dict[str, Any]:
    return {
        "contribution": name, "type": kind, "distribution": "normal", "scope": "unit", "input_unit": "", "source": source,
        "u": u, "divisor": 1.0, "stated": u, "dof": dof, "visible": float("nan"), "sensitivity": 1.0,
    }  # fmt: skip


def _sum(row: Mapping[str, Any], contributions: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Value, u of both types and together, ν_eff, k and U of one result."""
    parts = list(contributions)
    u = np.array([part["u"] for part in parts])
    random = np.array([part["type"] == "A" for part in parts])
    dof = effective_degrees(u[None, :], np.array([part["dof"] for part in parts])[None, :])
    k, combined = float(coverage_factors(dof)[0]), float(np.sqrt(np.sum(u**2)))
    order = [int(n) for n in np.argsort(-u, kind="stable")[:LARGEST] if u[n] > 0.0]
    largest = ", ".join(f"{LABELS[parts[n]['contribution']]} {100.0 * (u[n] / combined) ** 2:.0f} %" for n in order)
    return {
        "value": float(row["value"]), "u_a": float(np.sqrt(np.sum(u[random] ** 2))),
        "u_b": float(np.sqrt(np.sum(u[~random] ** 2))), "u": combined, "dof": float(dof[0]), "k": k, "expanded": k * combined,
        "shown": float("nan"), "unseen": float("nan"), "largest": largest,
    }  # fmt: skip
