"""A model's versions against the same measurements: whether the error fell where the model had not been fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.jobs.model_files import Version

FIGURES = {
    "fitted_ug": "rms_ug",
    "heldout_ug": "heldout_rms_ug",
    "fresh_ug": "fresh_rms_ug",
    "floor_ug": "floor_ug",
}
"""Figures of a version, and what a comparison calls them."""

JUDGED = ("fall_ug", "fall_u_ug", "confirmed")


class Compare(Protocol):
    """Errors of a model as :func:`pipelines.diagnosis.compare.compare` tells them."""

    def __call__(self, effects: list[str], before: list[str] | None) -> dict[str, Any]:
        """The comparison of a model; what was added to ``before`` is judged where that is given."""
        ...


def evolution(versions: Sequence[Version], compare: Compare) -> list[dict[str, Any]]:
    """One row per version: what changed, its errors, and in words whether the change is confirmed.

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
        row |= {name: None if progress is None else progress[name] for name in JUDGED}
        text = text_of(row, progress) if before is not None else "the model to begin with"
        rows.append({**row, "text": text, "warnings": errors.get("warnings", [])})
        before = effects
    return rows


def change_row(version: Version) -> dict[str, Any]:
    """What changed in a version, by whom, when, why."""
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
    """Whether a change is confirmed by data that were not fitted, in words."""
    if progress is None:
        return "taken away" if row["removed"] else "nothing added"
    fall = _fall(progress)
    if progress["judged_by"] == "fresh run":
        return _by_fresh(progress, fall)
    gain = progress["log_density"]
    if progress["confirmed"]:
        return f"confirmed on stretches of time left out (log density +{gain:.1f}); {fall}"
    if progress.get("rises"):
        return f"not decided by dwells left out: {progress['rises']}; {fall}; a fresh run of the same units decides"
    why = "they cannot judge it" if gain is None else f"log density {gain:+.1f}, more than 4 is needed"
    return f"not decided by dwells left out: {why}; {fall}; a fresh run of the same units decides"


def _by_fresh(progress: dict[str, Any], fall: str) -> str:
    part, error = progress["part"], progress["part_u"]
    if part is None:
        return "not decided: the fresh run's dwells do not show it; measure the same poses and temperatures again"
    came = f"{part:.2f} ± {2.0 * error:.2f} (k = 2) of the predicted change appears in the fresh run"
    if progress["confirmed"] is True:
        return f"confirmed: {came}; {fall}"
    if progress["confirmed"] is False:
        return f"refuted: {came}; {fall}"
    if progress.get("rises"):
        return f"not decided: {came}, but {progress['rises']}; {fall}"
    return f"not decided: {came}; {fall}; one more run"


def _fall(progress: dict[str, Any]) -> str:
    """By how much the error falls, with its uncertainty."""
    fall, error = progress["fall_ug"], progress["fall_u_ug"]
    if fall is None:
        return "no fold can judge the error"
    wide = "" if error is None else f" ± {2.0 * error:.2g} (k = 2)"
    return f"the error falls by {fall:.2g}{wide} µg" if fall >= 0.0 else f"the error rises by {-fall:.2g}{wide} µg"
