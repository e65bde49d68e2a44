"""What a certificate states of a unit's uncertainty, from the tables of its run: quantities, decisions, references."""

from __future__ import annotations

from typing import Any, NotRequired, cast

import numpy as np
import pandas as pd
from typing_extensions import TypedDict

from pipelines.archive import Run
from pipelines.tables.frames import rows_of
from schemas.errors import WrongUse
from schemas.reference import Reference


class StatedContribution(TypedDict):
    """One row of a budget (JCGM 100; EA-4/02): how an input is stated, and what it makes of the quantity.

    stated, divisor, input_unit : the figure as stated, and what makes a standard uncertainty of it; u : in the quantity's unit
    sensitivity : u over the input's standard uncertainty; None where several inputs make the contribution
    dof : None: infinite; visible : share that the residuals of the fit can show, None where that has no meaning
    """

    name: str
    type: str
    distribution: str
    divisor: float
    stated: float
    input_unit: str
    sensitivity: float | None
    u: float
    share: float
    dof: float | None
    visible: float | None
    scope: str
    source: str


class StatedQuantity(TypedDict):
    """A quantity with its combined and expanded uncertainty.

    u_a, u_b : of noise, and of references, station and device; dof : effective, None: infinite
    shown, unseen : of verification figures: what the station's own verification shows of u_b, and what it cannot
    """

    quantity: str
    axis: str
    unit: str
    value: float
    u_a: float
    u_b: float
    u: float
    dof: float | None
    k: float
    expanded: float
    frame: str
    shown: float | None
    unseen: float | None
    contributions: list[StatedContribution]


class StatedDecision(TypedDict):
    """A decision with its rule and its risk.

    expanded : U with the coverage factor of the limits; accept : largest value that is accepted, smallest where ``least`` is true
    pfa, pfr : specific probability of false acceptance and false rejection (JCGM 106, 7.4)
    """

    figure: str
    unit: str
    value: float
    expanded: float
    limit: float
    accept: float
    outcome: str
    least: NotRequired[bool]
    rule: str
    pfa: float
    pfr: float


class StatedReference(TypedDict):
    """Identity of a reference standard."""

    id: str
    what: str
    certificate: str
    laboratory: str
    accreditation: str
    date: str | None
    due: str
    U: float | None
    k: float | None
    unit: str | None
    drift_per_year: float | None
    sha256: str


class StatedBudget(TypedDict):
    """The uncertainty of one unit of a run.

    grade_source : what the figures rest on; validity_months : period that the error is stated for
    """

    run: str
    unit: str
    frame: str
    grade_source: str
    validity_months: int
    customer_agreed: bool
    quantities: list[StatedQuantity]
    decisions: list[StatedDecision]
    references: list[StatedReference]


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
    sums, parts, figures = (_of(run.table(name), unit) for name in ("uncertainties", "budget", "figures"))
    if sums.empty:
        raise WrongUse(
            f"run {run.id}: no uncertainty budget of unit {unit!r}; see 'tumbleline show {run.id} uncertainties'"
        )
    about = run.about
    recipe, station = about.get("recipe") or {}, about.get("station") or {}
    source = {**(station.get("uncertainty") or {}), **(recipe.get("uncertainty") or {})}.get("grade_source", "assumed")
    terms = run.manifest("budget")["parameters"].get("certificate") or {}
    return {
        "run": run.id,
        "unit": unit,
        "frame": str(sums["frame"].iloc[0]),
        "grade_source": str(source),
        "validity_months": int(terms.get("validity_months", 12)),
        "customer_agreed": bool(terms.get("customer_agreed", False)),
        "quantities": [_quantity(row, parts) for row in rows_of(sums)],
        "decisions": [_decision(row) for row in rows_of(figures) if np.isfinite(_edge(row))],
        "references": [_reference(one) for one in station.get("reference", [])],
    }


def _of(table: pd.DataFrame, unit: str) -> pd.DataFrame:
    return table[table["unit"] == unit]


def _quantity(row: dict[str, Any], parts: pd.DataFrame) -> StatedQuantity:
    own = parts[(parts["quantity"] == row["quantity"]) & (parts["axis"] == row["axis"])]
    return {
        "quantity": row["quantity"],
        "axis": row["axis"],
        "unit": row["unit_text"],
        **{name: float(row[name]) for name in ("value", "u_a", "u_b", "u", "k", "expanded")},
        "dof": _finite(row["dof"]),
        "frame": row["frame"],
        "shown": _finite(row["shown"]),
        "unseen": _finite(row["unseen"]),
        "contributions": [_contribution(one) for one in rows_of(own)],
    }  # pyright: ignore[reportReturnType] - the keys of the middle line are those of the type


def _contribution(row: dict[str, Any]) -> StatedContribution:
    return {
        "name": row["contribution"],
        "type": row["type"],
        "distribution": row["distribution"],
        "divisor": float(row["divisor"]),
        "stated": float(row["stated"]),
        "input_unit": row["input_unit"],
        "sensitivity": _finite(row["sensitivity"]),
        "u": float(row["u"]),
        "share": float(row["share"]),
        "dof": _finite(row["dof"]),
        "visible": _finite(row["visible"]),
        "scope": row["scope"],
        "source": row["source"],
    }


def _decision(row: dict[str, Any]) -> StatedDecision:
    stated: StatedDecision = {
        "figure": row["figure"],
        "unit": row["unit_text"],
        "value": float(row["value"]),
        "expanded": float(row["uncertainty"]),
        "limit": _edge(row),
        "accept": float(row["accept"]),
        "outcome": row["outcome"],
        "rule": row["rule"],
        "pfa": float(row["pfa"]),
        "pfr": float(row["pfr"]),
    }
    if np.isfinite(row.get("least", np.nan)):
        stated["least"] = True
    return stated


def _edge(row: dict[str, Any]) -> float:
    """The limit of a figure: of its magnitude, or its least value; nan where it has none."""
    return float(row["limit"] if np.isfinite(row["limit"]) else row.get("least", np.nan))


def _reference(document: dict[str, Any]) -> StatedReference:
    one = Reference.model_validate(document)
    days = {"date": None if one.date is None else one.date.isoformat(), "due": one.due.isoformat()}
    return cast(
        "StatedReference", {name: days.get(name, getattr(one, name)) for name in StatedReference.__annotations__}
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
