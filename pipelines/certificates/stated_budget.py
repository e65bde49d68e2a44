"""The uncertainty of a unit in its certificate, from the tables of its run: quantities, decisions, references."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipelines.archive import Run
from pipelines.tables.frames import rows_of
from schemas.errors import WrongUse
from schemas.reference import Reference

Row = dict[str, Any]


@dataclass(frozen=True)
class StatedBudget:
    """The uncertainty of one unit of a run.

    frame : frame of the results; grade_source : basis of the figures; validity_months : period for which the error is stated
    quantities : rows of ``uncertainties``, each with the rows of its budget (JCGM 100; EA-4/02)
    decisions : rows of ``figures`` with a limit; their ``pfa`` is the specific probability of false acceptance (JCGM 106, 7.4)
    """

    frame: str
    grade_source: str
    validity_months: int
    customer_agreed: bool
    quantities: tuple[tuple[Row, list[Row]], ...]
    decisions: tuple[Row, ...]
    references: tuple[Reference, ...]


def stated_budget(run: Run, unit: str) -> StatedBudget:
    """The uncertainty of a unit of a run.

    Raises
    ------
    WrongUse
        The run states none, or does not have the unit.
    """
    if "uncertainties" not in run.tables():
        raise WrongUse(
            f"run {run.id}: no uncertainty budget, one is needed; its station states no [uncertainty] (noise only)"
        )
    tables = (run.table(name) for name in ("uncertainties", "budget", "figures"))
    # filtered first, because a certificate is made for each unit of a large lot
    sums, parts, figures = (rows_of(table[table["unit"] == unit]) for table in tables)
    if not sums:
        raise WrongUse(
            f"run {run.id}: no uncertainty budget of unit {unit!r}; see 'tumbleline show {run.id} uncertainties'"
        )
    recipe, station = run.about.get("recipe") or {}, run.about.get("station") or {}
    entries = {**(station.get("uncertainty") or {}), **(recipe.get("uncertainty") or {})}
    terms = run.manifest("budget")["parameters"].get("certificate") or {}
    return StatedBudget(
        frame=str(sums[0]["frame"]),
        grade_source=str(entries.get("grade_source", "assumed")),
        validity_months=int(terms.get("validity_months", 12)),
        customer_agreed=bool(terms.get("customer_agreed", False)),
        quantities=tuple(
            (row, [part for part in parts if (part["quantity"], part["axis"]) == (row["quantity"], row["axis"])])
            for row in sums
        ),
        decisions=tuple(row for row in figures if np.isfinite(edge(row))),
        references=tuple(Reference.model_validate(reference) for reference in station.get("reference", [])),
    )


def edge(row: Row) -> float:
    """The limit of a figure: an upper limit of its magnitude, else a lower limit; nan if it has none."""
    return float(row["limit"] if np.isfinite(row["limit"]) else row.get("least", np.nan))
