"""Columns of dwells in the exchange format."""

from __future__ import annotations

import pandas as pd

REQUIRED = ("unit", "dwell", "time_s", "out_x", "out_y", "out_z")


FORCE = ("force_x", "force_y", "force_z")


ANGLES = ("outer_deg", "inner_deg")


DEVIATIONS = ("sd_x", "sd_y", "sd_z")


KNOWN = (
    *REQUIRED,
    *FORCE,
    *ANGLES,
    *DEVIATIONS,
    *("slot", "n", "duration_s", "unit_C", "chamber_C", "since_move_s", "since_power_s", "power_off_s"),
    *("supply_V", "vibration_g"),
    *("kind", "pose", "soak", "record", "out_unit", "outer_command_deg", "inner_command_deg", "full_scale", "rate_hz"),
)
"""Columns with a meaning; every other numeric column is a covariate."""


def covariates(frame: pd.DataFrame) -> list[str]:
    """Names of the numeric columns without a meaning of their own: what a missing effect may depend on."""
    return [name for name in frame.columns if name not in KNOWN and pd.api.types.is_numeric_dtype(frame[name])]
