"""Tables of a budget: one row per contribution, one per quantity, and the covariance of the coefficients."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array, Places
from inertial.uncertainty.degrees import coverage_factors, effective_degrees
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.stages.uncertainty.contributions import UncertaintySource
from pipelines.stages.uncertainty.measurands import BudgetQuantity, LotBudget, VarianceParts, quantities_of
from pipelines.tables.frames import empty_table, picked
from schemas.stated import Entry

NOISE, PRIOR = "noise", "prior"
BEYOND = {
    "run": "error found in the run",
    "budget": "references, as far as verification cannot show them",
    "flicker": "flicker to the due date",
    "switch_on": "bias from one switch-on to the next",
    "switch_on_scale": "scale from one switch-on to the next",
    "random_walk": "random walk of the run, carried on",
    "ageing": "ageing",
}
LABELS = {
    NOISE: "noise of the dwells",
    PRIOR: "prior of the family",
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
    "record_noise": "noise of the records",
    "repeatability": "repeatability of a point",
    "nominal_scale": "scale that the figure is compared with",
    "reference": "reference sensor",
    "drift": "drift of the reference sensor",
    "amplitude": "ratio of the channels, noise of the amplitude",
    "transverse": "transverse motion",
    "distortion": "distortion of the motion",
    "mounting": "mounting",
    "phase": "phase between the channels",
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
        "budget_covariance": empty_table(texts="unit", integers="row column", numbers="value"),
    }


@dataclass(frozen=True)
class _Contributions:
    """The contributions to one quantity of every unit, (units, c) where not said otherwise.

    names : c of them; u : standard uncertainties; about : columns of the table that are the same for every unit, c values each
    stated, dof, sensitivity : of each unit
    """

    names: list[str]
    u: Array
    about: dict[str, list[Any]]
    stated: Array
    dof: Array
    sensitivity: Array


def tables_of(
    lot: LotBudget, known: Mapping[str, UncertaintySource], left_out: Collection[tuple[str, str]] = ()
) -> dict[str, pd.DataFrame]:
    """The tables of a budget; every quantity for all units at once.

    Parameters
    ----------
    left_out : quantities by name and axis that are none of this lot
    """
    units, places = lot.calibration.units, groups_of(lot.variances)
    quantities = [quantity for quantity in quantities_of(lot) if (quantity.name, quantity.axis) not in left_out]
    parts = [_contributions(quantity, places, lot.variances, known, lot.terms) for quantity in quantities]
    return {
        "budget": _budget_rows(units, quantities, parts),
        "uncertainties": _sum_rows(units, quantities, parts, places, lot.terms),
        "budget_covariance": _covariance_rows(units, lot.variances.fit.covariance()),
    }


def has_uncertainty(row: Mapping[str, Any]) -> bool:
    """Whether a row of ``uncertainties`` has a U: a standard deviation or a bound over the period of validity has none.

    Earlier versions stored 0 for it.
    """
    return bool(row["expanded"] > 0.0)


def groups_of(variances: VarianceParts) -> dict[str, Places]:
    """Indices of the influences that make up each contribution, in order."""
    names = np.array(variances.fit.source.contributions, dtype=object)
    return {group: np.flatnonzero(names == group) for group in dict.fromkeys(names.tolist())}


def combined(quantity: BudgetQuantity, places: Mapping[str, Places]) -> tuple[Array, Array, Array]:
    """Standard uncertainty of type A, of type B and of both of a quantity, (units,) each."""
    noise = np.asarray(quantity.noise, dtype=float)
    if quantity.extra:  # an expected RMS: its contributions make its value, its uncertainty is that of the RMS
        stated = np.zeros_like(noise)
    else:
        groups = [values for name, values in _parts(quantity, places).items() if name not in {NOISE, PRIOR}]
        stated = np.sqrt(_summed(np.stack(groups, axis=1) ** 2)) if groups else np.zeros_like(noise)
    return noise, stated, np.hypot(noise, stated)


def _contributions(
    quantity: BudgetQuantity,
    places: Mapping[str, Places],
    variances: VarianceParts,
    known: Mapping[str, UncertaintySource],
    terms: BudgetTerms,
) -> _Contributions:
    uncertainties = _parts(quantity, places)
    u = np.ascontiguousarray(np.stack(list(uncertainties.values()), axis=1))
    stated, dof, sensitivity = u.copy(), np.full(u.shape, np.inf), np.full(u.shape, np.nan)
    about: dict[str, list[Any]] = {name: [] for name in SAME}
    for column, name in enumerate(uncertainties):
        if name in {NOISE, PRIOR} or name in BEYOND:
            row = _beyond(name, terms)
            if name in {NOISE, "run"}:
                dof[:, column] = quantity.dof_noise
        else:
            row = _referred(known[name], variances.visible[places[name]])
            stated[:, column], dof[:, column] = known[name].stated.stated, float(known[name].entry.dof or np.inf)
            single = known[name].stated.stated / known[name].stated.divisor if known[name].stated.unit else float("nan")
            if single > 0.0:
                sensitivity[:, column] = u[:, column] / single
        for key in SAME:
            about[key].append(row[key])
    return _Contributions(list(uncertainties), u, about, stated, dof, sensitivity)


def _parts(quantity: BudgetQuantity, places: Mapping[str, Places]) -> dict[str, Array]:
    """Standard uncertainty of every contribution, (units,) each; the noise first."""
    if quantity.extra:
        return {name: np.asarray(values, dtype=float) for name, values in quantity.extra.items()}
    out = {NOISE: np.asarray(quantity.noise, dtype=float)}
    if quantity.of_prior is not None:
        out |= {NOISE: out[NOISE] * np.sqrt(1.0 - quantity.of_prior), PRIOR: out[NOISE] * np.sqrt(quantity.of_prior)}
    for group, columns in places.items():
        out[group] = np.sqrt(np.sum(np.ascontiguousarray(quantity.parts[:, columns]) ** 2, axis=1))
    return out


SAME = ("visible", "type", "distribution", "scope", "input_unit", "divisor", "source")


def _beyond(name: str, terms: BudgetTerms) -> dict[str, Any]:
    """The source of the noise, or of a contribution beyond the run; its stated value is its uncertainty."""
    kind = "A" if name in {NOISE, PRIOR, "run", "flicker", "random_walk"} else "B"
    stability = f"[stability], {terms.stability.source}" if terms.stability else ""
    source = "the dwells of the run" if kind == "A" else stability
    source = "earlier calibrations of the family" if name == PRIOR else source
    return {"visible": float("nan"), "type": kind, "distribution": "normal", "scope": "unit", "input_unit": "", "divisor": 1.0,
            "source": source if name != "budget" else "[uncertainty]"}  # fmt: skip


def _referred(source: UncertaintySource, shares: Array) -> dict[str, Any]:
    """The source of a contribution that station or recipe state."""
    entry, stated = source.entry, source.stated
    return {
        "visible": float(np.sqrt(np.mean(shares**2))) if shares.size else float("nan"),
        "type": "B",
        "distribution": stated.distribution,
        "scope": entry.scope,
        "input_unit": stated.unit,
        "divisor": stated.divisor,
        "source": source_of(entry),
    }


def source_of(entry: Entry) -> str:
    """The origin of an entry: its reference standard, or its source."""
    return f"reference {entry.reference}" if entry.reference else entry.origin


def _share(u: Array) -> Array:
    """Share of each contribution in the sum of the squares, (units, c); zero where all are."""
    square = _summed(u**2)
    return np.divide(u**2, square[:, None], out=np.zeros_like(u), where=square[:, None] > 0.0)


def _summed(values: Array) -> Array:
    """Sums over the columns, one after the other: their order decides the last digit."""
    total = np.zeros(len(values))
    for column in values.T:
        total = total + column
    return total


def _budget_rows(
    units: Sequence[str], quantities: Sequence[BudgetQuantity], parts: Sequence[_Contributions]
) -> pd.DataFrame:
    rows = [
        (quantity, name)
        for quantity, contributions in zip(quantities, parts, strict=True)
        for name in contributions.names
    ]
    about = {name: [value for contributions in parts for value in contributions.about[name]] for name in SAME}

    def together(of: Callable[[_Contributions], Array]) -> Array:
        return np.concatenate([of(contributions) for contributions in parts], axis=1).ravel() if parts else np.empty(0)

    return pd.DataFrame(
        {
            "unit": [unit for unit in units for _ in rows],
            "quantity": [quantity.name for quantity, _ in rows] * len(units),
            "axis": [quantity.axis for quantity, _ in rows] * len(units),
            "unit_text": [quantity.unit for quantity, _ in rows] * len(units),
            "contribution": [name for _, name in rows] * len(units),
            "u": together(lambda contributions: contributions.u),
            "visible": about["visible"] * len(units),
            "sensitivity": together(lambda contributions: contributions.sensitivity),
            **{name: about[name] * len(units) for name in (*SAME[1:-2], "divisor")},
            "stated": together(lambda contributions: contributions.stated),
            "dof": together(lambda contributions: contributions.dof),
            "source": about["source"] * len(units),
            "share": together(lambda contributions: _share(contributions.u)),
        }
    )


def _sum_rows(
    units: Sequence[str],
    quantities: Sequence[BudgetQuantity],
    parts: Sequence[_Contributions],
    places: Mapping[str, Places],
    terms: BudgetTerms,
) -> pd.DataFrame:
    """Every quantity with its combined and expanded uncertainty."""
    columns: dict[str, list[Array]] = {name: [] for name in SUM_NUMBERS.split()}
    largest: list[list[str]] = []
    for quantity, contributions in zip(quantities, parts, strict=True):
        a, b, u = combined(quantity, places)
        none = np.full_like(a, np.nan)
        dof = none if quantity.extra else effective_degrees(contributions.u, contributions.dof)
        k = none if quantity.extra else coverage_factors(dof)
        row = {"value": quantity.value, "u_a": a, "u_b": b, "u": u, "dof": dof, "k": k, "expanded": k * u,
               "shown": none if quantity.shown is None else quantity.shown,
               "unseen": none if quantity.unseen is None else quantity.unseen}  # fmt: skip
        for name, values in row.items():
            columns[name].append(np.asarray(values, dtype=float))
        largest.append(_largest(contributions))
    many, count = len(units), len(quantities)
    numbers = {name: np.stack(values, axis=1).ravel() if values else np.empty(0) for name, values in columns.items()}
    return pd.DataFrame(
        {
            "unit": [unit for unit in units for _ in range(count)],
            "quantity": [quantity.name for quantity in quantities] * many,
            "axis": [quantity.axis for quantity in quantities] * many,
            "unit_text": [quantity.unit for quantity in quantities] * many,
            **numbers,
            "largest": [texts[unit] for unit in range(many) for texts in largest],
            "frame": [terms.certificate.frame] * (many * count),
        }
    )


def _largest(contributions: _Contributions) -> list[str]:
    """The three largest contributions of every unit with their shares, as text."""
    order, share = np.argsort(-contributions.u, axis=1, kind="stable")[:, :3], _share(contributions.u)
    labels = [LABELS[name] for name in contributions.names]
    return [
        ", ".join(f"{labels[c]} {100.0 * share[unit, c]:.0f} %" for c in chosen if share[unit, c] > 0.0)
        for unit, chosen in enumerate(order.tolist())
    ]


def _covariance_rows(units: Sequence[str], covariance: Array) -> pd.DataFrame:
    """Covariance (units, 3p, 3p) of the coefficients by the budget, x before y before z, as its lower triangles; output unit²."""
    many = np.broadcast_to(covariance, (len(units), *covariance.shape[-2:]))
    row, column = np.tril_indices(many.shape[-1])
    u, k = np.indices((len(units), row.size)).reshape(2, -1)
    return pd.DataFrame(
        {"unit": picked(units, u), "row": row[k], "column": column[k], "value": many[:, row, column].ravel()}
    )
