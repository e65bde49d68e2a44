"""Bias before and after shocks: its points, its shift, and whether a unit has survived."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.dynamics.stability import difference_error, error_of_mean, white_and_flicker
from pipelines.procedures.base import FigureValue, worst
from schemas.units import AXES, MICRO

if TYPE_CHECKING:
    import pandas as pd

    from pipelines.procedures.base import ProcedureRecord, UnitRecord

STUCK = 1e-9


def bias_points(
    unit: str, number: int, record: ProcedureRecord, own: UnitRecord, scale: np.ndarray
) -> list[dict[str, Any]]:
    """Mean of every axis in µg, its uncertainty from the scatter of ten parts; ``setting`` is 0 before, 1 after."""
    output = own.output / scale * MICRO
    error = error_of_mean(output)
    noise = [white_and_flicker(output[:, i], own.rate_hz) for i in range(3)]
    after = 0.0 if record.step.name == "before" else 1.0
    return [
        {
            "unit": unit, "axis": axis, "series": "bias", "point": number, "setting": after, "value": float(output[:, i].mean()),
            "uncertainty": float(error[i]), "white": noise[i][0], "flicker": noise[i][1], "window_s": len(output) / own.rate_hz,
        }
        for i, axis in enumerate(AXES)
    ]  # fmt: skip


def bias_shift(rows: pd.DataFrame) -> FigureValue:
    """Bias after minus before of the axis with the largest shift; the uncertainty holds white noise and flicker."""
    found: list[FigureValue] = []
    bias = rows[rows["series"] == "bias"]
    pooled = (
        difference_error(float(bias["white"].mean()), float(bias["flicker"].mean()), float(bias["window_s"].mean()))
        if len(bias)
        else 0.0
    )
    for axis, own in bias.groupby("axis", sort=False):
        before, after = own[own["setting"] == 0.0], own[own["setting"] > 0.0]
        if before.empty or after.empty:
            continue
        value = float(after["value"].iloc[0] - before["value"].iloc[0])
        error = max(pooled, float(np.hypot(after["uncertainty"].iloc[0], before["uncertainty"].iloc[0])))
        stuck = float(after["uncertainty"].iloc[0]) <= STUCK
        note = "the output is constant after the shocks: the unit has not survived" if stuck else ""
        found.append(FigureValue("shock_bias_shift_ug", str(axis), value, error, identified=not stuck, note=note))
    if not found:
        return FigureValue.not_determined("shock_bias_shift_ug", "*", "no bias before or after")
    return worst(found)
