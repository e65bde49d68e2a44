"""What a run's model takes off the residuals of a unit: before with bias, scale and misalignment, after with all its effects."""

import numpy as np
import pandas as pd

from inertial.quantities import FORCE_COLUMNS, shown_factor
from pipelines.report.effect_view import EffectView
from pipelines.report.run_pictures import COLUMNS, follows_most, quantities, timed
from schemas.units import MICRO, axes_among

LINEAR = ("bias", "scale", "misalignment")
FEW = 2  # effects that are named


def model_view(unit: str, dwells: pd.DataFrame, residuals: pd.DataFrame, effects: list[str]) -> EffectView:
    """The axis of a unit that the model changes most, against the quantity that its residuals follow most without it.

    dwells, residuals : of the fit, of the unit; effects : of the model. The residual of the model stands alone, of the axis where
    it is largest: without effects beyond the linear ones, without known forces, and where the fit in the forces along all axes
    leaves less than the model (weights, a prior, no misalignment), since the effects were not added to that fit then.
    """
    more = [effect for effect in effects if effect not in LINEAR]
    compared = bool(more) and set(FORCE_COLUMNS) <= set(dwells)
    both = residuals.assign(before_ug=_linear(dwells, residuals) if compared else residuals["residual_ug"])
    squares = (both[["before_ug", "residual_ug"]] ** 2).groupby(both["axis"]).mean().loc[axes_among(both["axis"])]
    fall = squares["before_ug"] - squares["residual_ug"]
    changed = compared and fall.max() > 0.0
    if not changed:
        both["before_ug"], fall = both["residual_ug"], squares["residual_ug"]
    axis = str(fall.idxmax())
    rows = both[both["axis"] == axis].sort_values("dwell")
    quantity = follows_most(rows.assign(residual_ug=rows["before_ug"]), dwells)
    column = COLUMNS.get(quantity, quantity)
    across = shown_factor(column) * timed(rows, dwells)[column].to_numpy(float)[None]
    before, after = (rows[name].to_numpy(float)[None] for name in ("before_ug", "residual_ug"))
    expected = rows["expected_ug"].to_numpy(float) if "expected_ug" in rows else np.zeros(1)
    return EffectView(
        ("" if not changed else ", ".join(more) if len(more) <= FEW else f"{len(more)} more effects"),
        quantities(rows, dwells)[quantity], axis, (unit,), 0, across,
        before, after if changed else None, before - after if changed else None, float(np.sqrt(np.mean(expected**2))),
    )  # fmt: skip


def _linear(dwells: pd.DataFrame, residuals: pd.DataFrame) -> pd.Series:
    """Residuals of least squares in the forces along all axes, µg, in the rows of ``residuals``."""
    left = pd.Series(np.nan, index=residuals.index)
    for axis, of_axis in residuals.groupby("axis"):
        rows = of_axis[["dwell"]].merge(dwells, on="dwell", how="left")
        force, output = rows[list(FORCE_COLUMNS)].to_numpy(float), rows[f"out_{axis}"].to_numpy(float)
        design = np.column_stack([np.ones(len(rows)), force])
        coefficients = np.linalg.lstsq(design, output, rcond=None)[0]
        scale = abs(float(coefficients[1 + "xyz".index(str(axis))]))
        left.loc[of_axis.index] = MICRO * (output - design @ coefficients) / scale
    return left
