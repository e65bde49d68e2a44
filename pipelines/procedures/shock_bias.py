"""Bias before and after shocks: its points, its shift, and whether a unit has survived."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics.stability import difference_error, error_of_mean, short_noise
from pipelines.procedures.columns import point_rows
from pipelines.procedures.figures import FigureValue, worst
from pipelines.procedures.noise_columns import noise_columns, pooled_noise
from pipelines.procedures.recorded import Taken
from schemas.units import AXES, MICRO

STUCK = 1e-9


def bias_points(one: Taken, scale: np.ndarray) -> list[dict[str, Any]]:
    """Mean of every axis in µg, its uncertainty from the scatter of ten parts; ``setting`` is 0 before, 1 after."""
    output, rate = one.own.output / scale * MICRO, one.own.rate_hz
    noise = [noise_columns(short_noise(output[:, i], rate)) for i in range(3)]
    return point_rows(
        unit=one.unit,
        axis=AXES,
        series="bias",
        point=one.number,
        setting=0.0 if one.record.step.name == "before" else 1.0,
        value=[output[:, i].mean() for i in range(3)],
        uncertainty=error_of_mean(output),
        window_s=len(output) / rate,
        time_s=float(one.own.time.mean()),
        **{name: [each[name] for each in noise] for name in noise[0]},
    )


def bias_shift(bias: pd.DataFrame) -> FigureValue:
    """Bias after minus before of the axis with the largest shift; the uncertainty holds white noise and flicker."""
    shifts: list[FigureValue] = []
    pooled = _pooled_error(bias) if len(bias) else 0.0
    for axis, own in bias.groupby("axis", sort=False):
        before, after = own[own["setting"] == 0.0], own[own["setting"] > 0.0]
        if before.empty or after.empty:
            continue
        value = float(after["value"].iloc[0] - before["value"].iloc[0])
        error = max(pooled, float(np.hypot(after["uncertainty"].iloc[0], before["uncertainty"].iloc[0])))
        stuck = float(after["uncertainty"].iloc[0]) <= STUCK
        note = "the output is constant after the shocks: the unit has not survived" if stuck else ""
        shifts.append(FigureValue("shock_bias_shift_ug", str(axis), value, error, identified=not stuck, note=note))
    if not shifts:
        return FigureValue.not_determined("shock_bias_shift_ug", "*", "no bias before or after")
    return worst(shifts)


def _pooled_error(bias: pd.DataFrame) -> float:
    """Standard uncertainty of after minus before by white noise and flicker, pooled over the axes."""
    window = float(bias["window_s"].mean())
    time = bias["time_s"].to_numpy(dtype=float) if "time_s" in bias else np.zeros(1)  # earlier versions have none
    return difference_error(pooled_noise(bias), window, float(np.ptp(time)))
