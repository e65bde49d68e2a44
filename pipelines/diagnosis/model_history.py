"""A model's versions against the same measurements: the errors on data that were not fitted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from inertial.decisions import CONFIRMED, LEFT_OUT
from pipelines.diagnosis.confirmation import fall_of
from pipelines.jobs.model_files import Version

FIGURES = {
    "fitted_ug": "rms_ug",
    "heldout_ug": "heldout_rms_ug",
    "fresh_ug": "fresh_rms_ug",
    "floor_ug": "floor_ug",
}
"""Figures of a version, with their keys in a comparison."""

JUDGED = ("fall_ug", "fall_u_ug", "confirmed", "reason")


Compare = Callable[[list[str], list[str] | None], dict[str, Any]]
"""Errors of a model as :func:`pipelines.diagnosis.compare.compare` states them; the effects added to the second are judged."""


def evolution(versions: Sequence[Version], compare: Compare) -> list[dict[str, Any]]:
    """One row per version: the change, its errors, and the verdict on the change as text.

    Parameters
    ----------
    versions : oldest first
    """
    rows: list[dict[str, Any]] = []
    before: list[str] | None = None
    for version in versions:
        effects = list(version.effects)
        errors = compare(effects, before if version.added else None)
        progress = errors.get("progress")
        row = {**change_row(version), **{name: errors[key] for name, key in FIGURES.items()}}
        row |= {name: None if progress is None else progress.get(name) for name in JUDGED}
        text = text_of(row, progress) if before is not None else "the model to begin with"
        rows.append({**row, "text": text, "warnings": errors.get("warnings", [])})
        before = effects
    return rows


def change_row(version: Version) -> dict[str, Any]:
    """The change of a version with author, date and reason."""
    change = version.change
    return {
        "version": version.number,
        "added": list(version.added),
        "removed": list(version.removed),
        "effects": list(version.effects),
        "by": change.by if change else "",
        "at": change.at.isoformat() if change else "",
        "why": change.why if change else "",
        "run": change.run if change else "",
    }


def text_of(row: dict[str, Any], progress: dict[str, Any] | None) -> str:
    """The verdict of unfitted data on a change, as text."""
    if progress is None:
        return "removed" if row["removed"] else "nothing added"
    fall = _fall(progress)
    if progress["judged_by"] == "fresh run":
        return _by_fresh(progress, fall)
    gain = progress["log_density"]
    if progress["confirmed"]:
        return f"confirmed on stretches of time left out (log density +{gain:.1f}), and the run shows no fault; {fall}"
    why = progress.get("reason") or "no judgement is possible"
    told = why if fall in why else f"{why}; {fall}"
    decides = "a fresh run of the same units decides"
    if gain is not None and gain > LEFT_OUT:
        return (
            f"holds on stretches of time left out (log density +{gain:.1f}), not decided by this run: {told}; {decides}"
        )
    return f"not decided by dwells left out: {told}; {decides}"


def _by_fresh(progress: dict[str, Any], fall: str) -> str:
    part, error = progress["part"], progress["part_u"]
    if part is None:
        return "not decided: the dwells of the fresh run do not show the effect; measure the same poses and temperatures again"
    came = f"{part:.2f} ± {2.0 * error:.2f} (k = 2) of the predicted change appears in the fresh run"
    if progress["confirmed"] is True:
        return f"confirmed: {came}; {fall}"
    if progress["confirmed"] is False:
        return f"refuted: {came}; {fall}"
    if part > CONFIRMED * error:  # the part alone would confirm it
        return f"not decided: {came}, but {progress.get('reason')}; {fall}; measure another run"
    return f"not decided: {came}; {fall}; measure another run"


def _fall(progress: dict[str, Any]) -> str:
    """The decrease of the error with its uncertainty; of a fresh run, without what may change from day to day."""
    fall = progress["fall_ug"]
    if fall is None:
        return "the error cannot be judged on dwells left out"
    beside = {"base": "the coefficients of the earlier model", "bias": "the bias of each unit"}
    again = beside.get(progress["estimated_again"] or "")
    return fall_of(fall, progress["fall_u_ug"]) + (f" where {again} may change from day to day" if again else "")
