"""Figures of shocks from their points: pulse, ratio to the reference, and why there is none."""

from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics import pulses
from inertial.dynamics.wander import stated_error
from pipelines.procedures.figures import FigureSpec, FigureValue
from pipelines.procedures.recorded import numbers

OF_PULSE = (
    FigureSpec("shock_peak_g", "g", "peak of the unit's pulse above its baseline; mean of the shocks", one_axis=True),
    FigureSpec("shock_duration_ms", "ms", "duration of the half sine with the unit's 10 % points", one_axis=True),
    FigureSpec("shock_velocity_m_s", "m/s", "velocity change, the integral over the unit's pulse", one_axis=True),
    FigureSpec(
        "shock_return_ms", "ms", "after the pulse, until the output stays within 2 % of the peak of where it ends"
    ),
    FigureSpec("shock_zero_shift_percent", "%", "output at the end of the record minus the baseline, of the peak"),
)
_COLUMNS = ("value", "duration_s", "velocity_m_s", "return_s", "zero_shift_percent")
_ERRORS = ("uncertainty", "duration_error_s", "velocity_error_m_s", "return_error_s", "zero_shift_error_percent")
_FACTORS = (1.0, 1e3, 1.0, 1e3, 1.0)
APART = 0.3
"""Departure of peak or duration from the reference's above which the two were not mounted on each other."""


CLIPS = ("", "the output", "the reference")
"""What clips, by the column ``clipped``."""


def texts_of(reference: pd.DataFrame, pulse: pd.DataFrame, others: pd.DataFrame) -> list[tuple[str, str]]:
    """Peak, duration and velocity change of the reference, or of the unit where it was recorded alone; other pulses."""
    shocks, name = (reference, "reference") if len(reference) else (pulse, "unit")
    if shocks.empty:
        return []
    peak, lasting = float(shocks["value"].abs().mean()), float(shocks["duration_s"].mean())
    text = (
        f"{name} {peak:.4g} g, {1e3 * lasting:.3g} ms, velocity change {float(shocks['velocity_m_s'].abs().mean()):.3g} m/s "
        f"(half sine: {pulses.velocity_change(peak, lasting):.3g} m/s; IEC 60068-2-27 allows ± 15 %)"
    )
    of_others = numbers(others, "setting", "value", "shock") if len(others) else ([], [], [])
    found = [
        f"{peak:.3g} g at {at:.4g} s of record {number + 1:.0f}" for at, peak, number in zip(*of_others, strict=True)
    ]
    left_out = f"{', '.join(found)}; the figures are those of the largest pulse, up to the next one"
    return [("pulse", text), *([("another pulse", left_out)] if found else [])]


def comparable(rows: pd.DataFrame) -> bool:
    """Whether a shock has a ratio of two sensors on each other."""
    ratio, reference, pulse = (rows[rows["series"] == name] for name in ("ratio", "reference", "pulse"))
    good = ratio[np.isfinite(ratio["value"])]
    return len(good) > 0 and not no_comparison(good, reference, pulse)


def no_comparison(good: pd.DataFrame, reference: pd.DataFrame, pulse: pd.DataFrame) -> str:
    """Why the pulses of unit and reference are not those of two sensors on each other; empty where they may be."""
    if good.empty or reference.empty or pulse.empty:
        return ""
    peak = float(good["value"].mean())
    lasting = float(pulse["duration_s"].mean()) / float(reference["duration_s"].mean())
    if abs(peak + 1.0) < APART:
        return f"the peak is {peak:.3g} times that of the reference: its sign is turned over; correct the sign of one channel"
    for what, ratio in (("the peak", peak), ("the duration", lasting)):
        if not abs(ratio - 1.0) < APART:
            return (
                f"{what} is {ratio:.3g} times that of the reference: two places of a structure are no comparison; mount the unit "
                "on the reference, or check the scale and the polarity"
            )
    return ""


def ratio_figures(part: Any, ratio: pd.DataFrame, good: pd.DataFrame, apart: str) -> list[FigureValue]:
    """Sensitivity and undershoot by comparison; ``apart``: why there is no comparison."""
    names = ("shock_sensitivity_percent", "shock_undershoot_percent")
    if len(ratio) and "alone" in ratio and bool((ratio["alone"] > 0.0).any()):
        note = "recorded without a reference, which a comparison needs; record one beside the unit"
        return [FigureValue.not_measured(name, part.axis, note) for name in names]
    note = apart or _without(ratio, len(good))
    if note:
        return [FigureValue.not_determined(name, part.axis, note) for name in names]
    _, value, each = numbers(good)
    scatter = float(value.std(ddof=1) / np.sqrt(value.size)) if value.size > 2 else 0.0
    spread = max(scatter, float(np.sqrt(np.mean(each**2)) / np.sqrt(value.size)))
    under = good["undershoot_percent"].to_numpy(dtype=float)
    floor = 100.0 * float(good["noise_g"].mean()) / part.peak_g / np.sqrt(under.size)
    # shocks differ in duration, and so in undershoot: of a few, their scatter is itself uncertain
    scatter = float(under.std(ddof=1) / np.sqrt(under.size)) if under.size > 1 else 0.0
    error = float(np.hypot(100.0 * spread, part.reference_percent))
    under_error = stated_error(floor**2 + scatter**2, 1.0, scatter**2 * np.sqrt(2.0 / max(1, under.size - 1)))
    return [
        FigureValue(names[0], part.axis, float(100.0 * (value.mean() - 1.0)), error),
        FigureValue(names[1], part.axis, float(under.mean()), under_error),
    ]


def _without(ratio: pd.DataFrame, good: int) -> str:
    """Why there is no comparison; empty where every shock was compared."""
    if ratio.empty:
        return "0 of 0 shocks show no pulse; check cable and mounting"
    clipped = int((ratio["clipped"] > 0.0).sum())
    if clipped:
        what = CLIPS[int(ratio["clipped"].max())]
        return f"{clipped} of {len(ratio)} shocks clip {what}; lower the peak, or choose a wider range"
    if "earlier" in ratio and bool((ratio["earlier"] > 0.0).any()):
        return (
            "another pulse lies before the largest, in its baseline; give a file that begins after it, or shock again"
        )
    lone = ratio["lone_s"].dropna() if "lone_s" in ratio else ratio["value"].iloc[:0]
    if len(lone):
        return (
            f"{len(lone)} of {len(ratio)} shocks {'has' if len(lone) == 1 else 'have'} a sample that departs alone, at "
            f"{lone.iloc[0]:.6g} s of its record; check the data line, shock again"
        )
    return (
        f"{len(ratio) - good} of {len(ratio)} shocks show no pulse; check cable and mounting"
        if good < len(ratio)
        else ""
    )


def pulse_figures(axis: str, pulse: pd.DataFrame, ratio: pd.DataFrame) -> list[FigureValue]:
    """Peak, duration, velocity change, return and zero shift of the unit, means of the shocks; polarity apart."""
    if pulse.empty or len(pulse) < len(ratio):
        note = _without(ratio, len(pulse)) or "0 shocks show a pulse; check cable and mounting"
        return [FigureValue.not_determined(spec.name, axis, note) for spec in OF_PULSE]
    figures: list[FigureValue] = []
    for spec, column, of_error, factor in zip(OF_PULSE, _COLUMNS, _ERRORS, _FACTORS, strict=True):
        value = factor * numbers(pulse, column)[0]
        value = np.abs(value) if column == "value" else value
        if not np.isfinite(value).all():
            note = "the output does not come to rest; record longer"
            figures.append(FigureValue.not_determined(spec.name, axis, note))
            continue
        each = factor * numbers(pulse, of_error)[0]
        scatter = float(value.std(ddof=1)) if value.size > 1 else 0.0
        error = float(np.hypot(scatter, np.sqrt(np.mean(each**2)))) / np.sqrt(value.size)
        figures.append(FigureValue(spec.name, axis, float(value.mean()), error))
    return figures
