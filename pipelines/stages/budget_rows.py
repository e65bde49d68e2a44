"""Tables of a budget: one row per contribution, one per quantity, and the covariance of the coefficients."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from inertial.uncertainty.degrees import coverage_factor, welch_satterthwaite
from pipelines.tables.frames import empty_table, picked

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from pipelines.stages.budget_terms import BudgetTerms
    from pipelines.stages.contributions import UncertaintySource
    from pipelines.stages.quantities import BudgetQuantity, VarianceParts

    Array = NDArray[np.float64]

NOISE = "noise"
BEYOND = {
    "run": "figure of the run",
    "budget": "references, as far as verification cannot show them",
    "flicker": "flicker to the due date",
    "switch_on": "bias from one switch-on to the next",
    "switch_on_scale": "scale from one switch-on to the next",
    "ageing": "ageing",
}
LABELS = {
    NOISE: "noise of the dwells",
    "gravity": "local gravity",
    "level": "level of the base",
    "orthogonality": "orthogonality of the table's axes",
    "outer_offset": "offset of the outer encoder",
    "inner_offset": "offset of the inner encoder",
    "harmonics": "harmonics of the encoders",
    "pose": "repeatability of the poses",
    "seat": "seat of the fixture",
    "thermometer_offset": "offset of the thermometer",
    "thermometer_slope": "slope of the thermometer",
    "thermometer_soak": "thermometer from soak to soak",
    "gradient": "gradient to the element",
    "settling": "settling of the temperature",
    "supply": "supply",
    "reader_gain": "gain of the reader",
    "reader_offset": "offset of the reader",
    "reader_inl": "nonlinearity of the reader",
    "timing": "timing",
    "creep": "creep after a move",
    "vibration": "vibration",
    **BEYOND,
}
"""Titles of the contributions in tables and pictures."""
TEXTS = "unit quantity axis contribution unit_text type distribution scope input_unit source"
NUMBERS = "u share divisor stated dof sensitivity visible"
SUM_TEXTS = "unit quantity axis unit_text largest frame"
SUM_NUMBERS = "value u_a u_b u dof k expanded shown unseen"


def empty() -> dict[str, pd.DataFrame]:
    """The tables without rows: nothing is stated."""
    return {
        "budget": empty_table(texts=TEXTS, numbers=NUMBERS),
        "uncertainties": empty_table(texts=SUM_TEXTS, numbers=SUM_NUMBERS),
        "budget_covariance": empty_table(texts="unit", whole="row column", numbers="value"),
    }


def rows_of_quantities(
    units: Sequence[str],
    quantities: Sequence[BudgetQuantity],
    found: VarianceParts,
    terms: BudgetTerms,
    known: Mapping[str, UncertaintySource],
) -> dict[str, pd.DataFrame]:
    """Tables ``budget`` and ``uncertainties``."""
    names = np.array(found.fit.source.contributions, dtype=object)
    groups = list(dict.fromkeys(names.tolist()))
    places = {group: np.flatnonzero(names == group) for group in groups}
    rows: list[dict[str, Any]] = []
    sums: list[dict[str, Any]] = []
    for number, unit in enumerate(units):
        for one in quantities:
            parts = _parts(one, number, groups, places)
            head = {"unit": unit, "quantity": one.name, "axis": one.axis, "unit_text": one.unit}
            square = sum(u**2 for u in parts.values())
            own: list[dict[str, Any]] = [
                {
                    **head,
                    **_about(name, u, one, number, found, places, known, terms),
                    "share": u**2 / square if square > 0.0 else 0.0,
                }
                for name, u in parts.items()
            ]
            rows += own
            sums.append(_sum(unit, one, number, own, terms))
    return {"budget": pd.DataFrame(rows), "uncertainties": pd.DataFrame(sums)}


def _parts(
    one: BudgetQuantity, unit: int, groups: Sequence[str], places: Mapping[str, NDArray[np.intp]]
) -> dict[str, float]:
    """Standard uncertainty of every contribution."""
    if one.extra:
        return {name: float(values[unit]) for name, values in one.extra.items()}
    out = {NOISE: float(one.noise[unit])}
    for group in groups:
        out[group] = float(np.sqrt(np.sum(one.parts[unit, places[group]] ** 2)))
    return out


def _about(
    name: str, u: float, one: BudgetQuantity, unit: int, found: VarianceParts, places: Mapping[str, NDArray[np.intp]],
    known: Mapping[str, UncertaintySource], terms: BudgetTerms,
) -> dict[str, Any]:  # fmt: skip
    """The source of a contribution."""
    plain = {"contribution": name, "u": u, "visible": float("nan"), "sensitivity": float("nan")}
    if name == NOISE or name in BEYOND:
        dof = float(one.dof_noise[unit]) if name in {NOISE, "run"} else float("inf")
        kind = "A" if name in {NOISE, "run", "flicker"} else "B"
        where = (
            "the dwells of the run"
            if kind == "A"
            else f"[stability], {terms.stability.source}"
            if terms.stability
            else ""
        )
        scope = "unit"
        return {**plain, "type": kind, "distribution": "normal", "scope": scope, "input_unit": "", "divisor": 1.0, "stated": u,
                "dof": dof, "source": where if name != "budget" else "[uncertainty]"}  # fmt: skip
    source = known[name]
    entry, stated = source.entry, source.stated
    single = stated.stated / stated.divisor if stated.unit else float("nan")
    shares = found.visible[places[name]]
    return {
        **plain,
        "type": "B",
        "distribution": stated.distribution,
        "scope": entry.scope,
        "input_unit": stated.unit,
        "divisor": stated.divisor,
        "stated": stated.stated,
        "dof": float(entry.dof or np.inf),
        "sensitivity": u / single if single > 0.0 else float("nan"),
        "visible": float(np.sqrt(np.mean(shares**2))) if shares.size else float("nan"),
        "source": f"reference {entry.reference}" if entry.reference else entry.origin,
    }


def _sum(
    unit: str, one: BudgetQuantity, number: int, own: Sequence[dict[str, Any]], terms: BudgetTerms
) -> dict[str, Any]:
    """The quantity with its combined and expanded uncertainty."""
    if (
        one.extra
    ):  # the quantity is an expected RMS: its contributions make its value, its uncertainty is that of the RMS
        a, b = float(one.noise[number]), 0.0
        dof = float(one.dof_noise[number])
    else:
        a = float(one.noise[number])
        b = float(np.sqrt(sum(row["u"] ** 2 for row in own if row["type"] == "B")))
        dof = welch_satterthwaite([row["u"] for row in own], [row["dof"] for row in own])
    u = float(np.hypot(a, b))
    k = coverage_factor(dof)
    largest = sorted(own, key=lambda row: -row["u"])[:3]
    return {
        "unit": unit,
        "quantity": one.name,
        "axis": one.axis,
        "unit_text": one.unit,
        "value": float(one.value[number]),
        "u_a": a,
        "u_b": b,
        "u": u,
        "dof": dof,
        "k": k,
        "expanded": k * u,
        "shown": float("nan") if one.shown is None else float(one.shown[number]),
        "unseen": float("nan") if one.unseen is None else float(one.unseen[number]),
        "largest": ", ".join(
            f"{LABELS[r['contribution']]} {100.0 * r['share']:.0f} %" for r in largest if r["share"] > 0.0
        ),
        "frame": terms.certificate.frame,
    }


def covariance_rows(units: Sequence[str], covariance: Array) -> pd.DataFrame:
    """Covariance (units, 3p, 3p) of the coefficients by the budget, x before y before z, as its lower triangles; output unit²."""
    many = np.broadcast_to(covariance, (len(units), *covariance.shape[-2:]))
    row, column = np.tril_indices(many.shape[-1])
    u, k = (index.ravel() for index in np.meshgrid(np.arange(len(units)), np.arange(row.size), indexing="ij"))
    return pd.DataFrame(
        {"unit": picked(units, u), "row": row[k], "column": column[k], "value": many[:, row, column].ravel()}
    )
