"""A model's versions against the same measurements: whether the error fell where the model had not been fitted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pipelines.jobs.model_files import Version

FALLS = 0.005
"""Share by which an error must fall to count: an effect that is not there moves it by less, and mostly upwards."""

FIGURES = ("rms_ug", "heldout_rms_ug", "fresh_rms_ug", "floor_ug")


def evolution(versions: Sequence[Version], compare: Callable[[list[str]], dict[str, Any]]) -> list[dict[str, Any]]:
    """One row per version: what changed, its errors, and in words whether the change is confirmed.

    Parameters
    ----------
    versions : oldest first
    compare : errors of a model, as :func:`pipelines.diagnosis.compare.compare` tells them
    """
    rows: list[dict[str, Any]] = []
    for version in versions:
        errors = compare(list(version.effects))
        row = {**told(version), **{name: errors[name] for name in FIGURES}}
        confirmed, words = judged(rows[-1] if rows else None, row)
        rows.append({**row, "confirmed": confirmed, "words": words})
    return rows


def told(version: Version) -> dict[str, Any]:
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


def judged(before: dict[str, Any] | None, after: dict[str, Any]) -> tuple[bool | None, str]:
    """Whether a change is confirmed by data that were not fitted; None where nothing was added."""
    if before is None or not after["added"]:
        return None, "the model to begin with" if before is None else "taken away"
    name = ", ".join(after["added"])
    fresh = after["fresh_rms_ug"] is not None
    figure, where = ("fresh_rms_ug", "on the fresh run") if fresh else ("heldout_rms_ug", "on poses left out")
    if after[figure] < (1.0 - FALLS) * before[figure]:
        return True, f"confirmed: the error falls {where}"
    if after["rms_ug"] < (1.0 - FALLS) * before["rms_ug"]:
        return False, f"NOT confirmed: {name} fits the run better, but the error does not fall {where}"
    return False, f"NOT confirmed: {name} changes nothing; the error does not fall {where}"
