"""Causes of differences between two runs: data, code, model, limits and library versions, from the manifests of their stages."""

from __future__ import annotations

from typing import Any

from pipelines.archive import Run
from pipelines.chain.chain import BY_NAME

ORDER = ("import", "capture", *BY_NAME)
DATA = ("records", "source")
MODEL = ("effects", "formulas")


def causes(a: Run, b: Run) -> list[dict[str, Any]]:
    """The causes of differences between two runs, without differences that only follow from an earlier cause.

    Every row has ``what`` (data, model, limits, code, library, another parameter), its ``stage``, and the values in both runs.
    """
    rows = _data(a, b) + _chosen(a, b)
    seen: set[tuple[str, str]] = {("model", ""), ("limits", "")}
    for stage, (before, after) in _manifests(a, b).items():
        rows += [row for row in _of_stage(stage, before, after) if (row["what"], row["name"]) not in seen]
        seen |= {(row["what"], row["name"]) for row in rows if row["what"] == "library"}
    return rows


def _row(what: str, name: str, before: Any, after: Any, stage: str = "") -> dict[str, Any]:
    return {"what": what, "stage": stage, "name": name, "a": before, "b": after}


def _data(a: Run, b: Run) -> list[dict[str, Any]]:
    """Whether the runs have different measurements."""
    before, after = (_measured(run) for run in (a, b))
    return [] if before == after else [_row("data", "", before, after)]


def _measured(run: Run) -> str:
    """The identity of the data of a run: its capture, the imported file, or its first dwells."""
    about = run.about
    if about.get("capture"):
        return str(about["capture"])
    if "source" in about:
        return str(about["source"].get("sha256", ""))[:16]
    return str(run.manifest("dwells")["sha256"])[:16] if "dwells" in run.tables() else ""


def _chosen(a: Run, b: Run) -> list[dict[str, Any]]:
    """Differences of model and limits, by their names."""
    rows: list[dict[str, Any]] = []
    before, after = (_model(run) for run in (a, b))
    if before != after:
        rows.append(_row("model", "", _model_text(before, after), _model_text(after, before)))
    first, second = (run.about.get("limits") for run in (a, b))
    if first != second:
        changed = _limits_text(first or {}, second or {})
        rows.append(_row("limits", changed, (first or {}).get("name", "none"), (second or {}).get("name", "none")))
    return rows


def _model(run: Run) -> dict[str, Any]:
    recipe = run.about.get("recipe", {})
    if recipe.get("effects"):
        return {"effects": list(recipe["effects"]), "formulas": recipe.get("formulas", [])}
    return {"effects": [], "formulas": []}


def _model_text(own: dict[str, Any], other: dict[str, Any]) -> str:
    """A short text for a model: its effects beyond the other model, or all its effects where neither contains the other."""
    more = [effect for effect in own["effects"] if effect not in other["effects"]]
    if more or len(own["effects"]) < len(other["effects"]):
        kept = len(own["effects"]) - len(more)
        return f"{kept} effects" + "".join(f" + {effect}" for effect in more)
    return ", ".join(own["effects"]) or "none"


def _limits_text(before: dict[str, Any], after: dict[str, Any]) -> str:
    """The keys of the limits that differ."""
    a, b = before.get("figures", {}), after.get("figures", {})
    names = [name for name in {**a, **b} if a.get(name) != b.get(name)]
    names += [key for key in ("rule", "coverage_factor", "grade") if before.get(key) != after.get(key)]
    return ", ".join(names)


def _manifests(a: Run, b: Run) -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Manifests of every stage that both runs have, in the order of the chain."""
    first, second = (_by_stage(run) for run in (a, b))
    common = [stage for stage in ORDER if stage in first and stage in second]
    return {stage: (first[stage], second[stage]) for stage in common}


def _by_stage(run: Run) -> dict[str, dict[str, Any]]:
    manifests = [run.manifest(name) for name in run.tables()]
    return {manifest["stage"]: manifest for manifest in manifests}


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
