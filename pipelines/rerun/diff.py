"""Differences between two runs: grades, coefficients and figures relative to their uncertainty, and the causes."""

from typing import Any

import numpy as np
import pandas as pd

from pipelines.archive import Run
from pipelines.chain.chain import BY_NAME
from pipelines.tables.frames import rows_of
from schemas.errors import DataRejected

COEFFICIENT = ["unit", "axis", "effect", "name"]
FIGURE = ["unit", "figure"]
PLAIN_FACTOR = 2.0


def diff(a: Run, b: Run) -> dict[str, Any]:
    """The differences of two runs as a document: units with a changed grade first, then by change relative to uncertainty.

    ``over_a`` and ``over_b`` are a change over the standard uncertainty of either, ``over_both`` over that of their difference if
    the two were independent, √(u_a² + u_b²): two analyses of one measurement are not, so there a change of one standard
    uncertainty is large.

    Raises DataRejected: the runs have no unit in common, or nothing to compare.
    """
    coefficients = changed(_table(a, "coefficients"), _table(b, "coefficients"), COEFFICIENT, "standard_error")
    figures_a, figures_b = (with_standard_error(run.about, _table(run, "figures")) for run in (a, b))
    figures = changed(figures_a, figures_b, FIGURE, "standard_error")
    before, after = _grades(a), _grades(b)
    if before.keys().isdisjoint(after):
        raise DataRejected(
            f"diff: runs {a.id} and {b.id} have no unit in common, one is needed; name two runs of the same units"
        )
    units = _units(before, after, coefficients)
    return {
        "a": a.id,
        "b": b.id,
        "same": not any(row["changed"] for row in units) and not len(coefficients) and not len(figures),
        "because": causes(a, b),
        "flipped": [row["unit"] for row in units if row["flipped"]],
        "units": units,
        "coefficients": rows_of(coefficients.drop(columns="largest")),
        "figures": rows_of(figures.drop(columns="largest")),
        "only_a": [unit for unit in before if unit not in after],
        "only_b": [unit for unit in after if unit not in before],
    }


def _table(run: Run, name: str) -> pd.DataFrame:
    """A table of a run, without rows where the run has none."""
    if name in run.tables():
        return run.table(name)
    if name == "coefficients":
        raise DataRejected(
            f"run {run.id}: it has no coefficients, they are needed for a comparison; finish the run, or re-run it first"
        )
    return pd.DataFrame({"unit": [], "figure": [], "value": [], "uncertainty": [], "limit": [], "unit_text": []})


def coverage_of(about: dict[str, Any]) -> float:
    """The coverage factor k of a run: of its limits, 2 where it has none."""
    return float((about.get("limits") or {}).get("coverage_factor", PLAIN_FACTOR))


def with_standard_error(about: dict[str, Any], figures: pd.DataFrame) -> pd.DataFrame:
    """Figures of a run with their standard uncertainty; the table has the expanded one, with the factor of the limits.

    Runs of versions before the risk of decisions have figures without a limit with twice the standard uncertainty, whatever the
    factor of their limits.
    """
    limited = figures["limit"].notna() | ("pfa" in figures)
    factor = np.where(limited, coverage_of(about), PLAIN_FACTOR)
    return figures.assign(standard_error=figures["uncertainty"].astype(float) / factor)


def changed(a: pd.DataFrame, b: pd.DataFrame, key: list[str], error: str) -> pd.DataFrame:
    """Rows whose value or uncertainty differs, and rows that only one of the tables has."""
    keep = [*key, "value", error, "unit_text"]
    both = a[keep].merge(b[keep], on=key, how="outer", suffixes=("_a", "_b"))
    u_a, u_b = both[f"{error}_a"], both[f"{error}_b"]
    other_unit = both["unit_text_a"].ne(both["unit_text_b"]) & both["value_a"].notna() & both["value_b"].notna()
    change = (both["value_b"] - both["value_a"]).mask(other_unit)
    compared = both[key].assign(
        unit_text=both["unit_text_b"].fillna(both["unit_text_a"]),
        a=both["value_a"],
        b=both["value_b"],
        change=change,
        u_a=u_a,
        u_b=u_b,
        over_a=_over(change, u_a),
        over_b=_over(change, u_b),
        over_both=_over(change, (u_a**2 + u_b**2) ** 0.5),
    )
    same = (both["value_a"] == both["value_b"]) & (u_a == u_b)
    compared = compared[~same]
    alone = compared["a"].isna() | compared["b"].isna()
    largest = compared["over_both"].abs().fillna(0.0).mask(alone, np.inf)
    return compared.assign(largest=largest).sort_values(["largest", *key], ascending=[False, *[True] * len(key)])


def _over(change: pd.Series, size: pd.Series) -> pd.Series:
    """A change over an uncertainty; None without an uncertainty."""
    return change / size.where(size > 0.0)


def _units(
    before: dict[str, dict[str, Any]], after: dict[str, dict[str, Any]], coefficients: pd.DataFrame
) -> list[dict[str, Any]]:
    """One row for every unit of both runs, changed grades first."""
    finite = coefficients[np.isfinite(coefficients["largest"].to_numpy(dtype=float))]
    largest = finite.groupby("unit")["largest"].max().to_dict()
    moved = set(coefficients["unit"])
    rows: list[dict[str, Any]] = []
    for unit in (unit for unit in before if unit in after):
        pairs = {key: [before[unit][key], after[unit][key]] for key in ("outcome", "grade", "reasons")}
        differs = {key: first != other for key, (first, other) in pairs.items()}
        flipped = differs["outcome"] or differs["grade"]
        head = {"unit": unit, "flipped": flipped, "changed": flipped or unit in moved or differs["reasons"]}
        rows.append({**head, **pairs, "largest_over_both": float(largest.get(unit, 0.0))})
    return sorted(
        rows, key=lambda row: (not row["flipped"], not row["changed"], -row["largest_over_both"], row["unit"])
    )


def _grades(run: Run) -> dict[str, dict[str, Any]]:
    """Grade of every unit; empty for a run without grades."""
    if "grades" in run.tables():
        return {row["unit"]: row for row in rows_of(run.table("grades"))}
    units = dict.fromkeys(run.table("coefficients")["unit"].astype(str))
    return {unit: {"outcome": "", "grade": "", "reasons": ""} for unit in units}


ORDER = ("import", "capture", *BY_NAME)
MODEL = ("effects", "formulas")


def causes(a: Run, b: Run) -> list[dict[str, Any]]:
    """The causes of differences between two runs, without differences that only follow from an earlier cause.

    Every row has ``what`` (data, model, limits, code, library, another parameter), its ``stage``, and the values in both runs.
    """
    rows = _chosen(a, b)
    seen: set[tuple[str, str]] = {("model", ""), ("limits", "")}
    for stage, (before, after) in _manifests(a, b).items():
        rows += [row for row in _of_stage(stage, before, after) if (row["what"], row["name"]) not in seen]
        seen |= {(row["what"], row["name"]) for row in rows if row["what"] == "library"}
    return rows


def _row(what: str, name: str, before: Any, after: Any, stage: str = "") -> dict[str, Any]:
    return {"what": what, "stage": stage, "name": name, "a": before, "b": after}


def _measured(run: Run) -> str:
    """The identity of the data of a run: its capture, the imported file, or its first dwells."""
    about = run.about
    if about.get("capture"):
        return str(about["capture"])
    if "source" in about:
        return str(about["source"].get("sha256", ""))[:16]
    return str(run.manifest("dwells")["sha256"])[:16] if "dwells" in run.tables() else ""


def _chosen(a: Run, b: Run) -> list[dict[str, Any]]:
    """Differences of the measurements, and of model and limits, by their names."""
    rows: list[dict[str, Any]] = []
    data, models, limits = zip(*((_measured(run), _model(run), run.about.get("limits")) for run in (a, b)), strict=True)
    if data[0] != data[1]:
        rows.append(_row("data", "", *data))
    if models[0] != models[1]:
        rows.append(_row("model", "", _model_text(*models), _model_text(*reversed(models))))
    if limits[0] != limits[1]:
        first, second = (limit or {} for limit in limits)
        decided = [key for key in ("rule", "coverage_factor", "grade") if first.get(key) != second.get(key)]
        old, new = first.get("figures", {}), second.get("figures", {})
        named = ", ".join(name for name in {**old, **new} if old.get(name) != new.get(name))
        if named or not decided:
            rows.append(_row("limits", named, *(limit.get("name", "none") for limit in (first, second))))
        rows += [_row("limits", key, *(limit.get(key, "none") for limit in (first, second))) for key in decided]
    return rows


def _model(run: Run) -> dict[str, Any]:
    recipe = run.about.get("recipe", {})
    effects = list(recipe.get("effects") or ())
    return {"effects": effects, "formulas": recipe.get("formulas", []) if effects else []}


def _model_text(model: dict[str, Any], other: dict[str, Any]) -> str:
    """A short text for a model: its effects beyond the other model, or all its effects where neither contains the other."""
    more = [effect for effect in model["effects"] if effect not in other["effects"]]
    if more or len(model["effects"]) < len(other["effects"]):
        return " + ".join([f"{len(model['effects']) - len(more)} effects", *more])
    return ", ".join(model["effects"]) or "none"


def _manifests(a: Run, b: Run) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Manifests of every stage that both runs have, in the order of the chain."""
    first, second = ({manifest["stage"]: manifest for manifest in map(run.manifest, run.tables())} for run in (a, b))
    return {stage: (first[stage], second[stage]) for stage in ORDER if stage in first and stage in second}


def _of_stage(stage: str, before: dict[str, Any], after: dict[str, Any]) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    if before.get("code") != after.get("code"):
        rows.append(_row("code", stage, str(before.get("code", ""))[:12], str(after.get("code", ""))[:12], stage))
    a, b = before.get("parameters", {}), after.get("parameters", {})
    known = [*MODEL, "limits", "capture", "mapping", "lot"]
    names = [name for name in a if name in b and a[name] != b[name] and name not in known]
    rows += [_row("parameter", name, a[name], b[name], stage) for name in names]
    x, y = before.get("libraries", {}), after.get("libraries", {})
    rows += [_row("library", name, x.get(name), y.get(name)) for name in sorted({*x, *y}) if x.get(name) != y.get(name)]
    return rows
