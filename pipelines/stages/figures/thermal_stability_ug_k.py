"""Thermal stability: span of the fitted bias over the temperatures of the run, over their span, of the worst axis."""

from __future__ import annotations

import numpy as np

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, effect_in_model

EFFECTS = ("bias_temperature", "bias_temperature_quadratic", "bias_temperature_cubic")
REFERENCE_C = 25.0
LEVELS = 61


def _value(tables: UnitTables) -> Value | None:
    """The uncertainty is that of the linear coefficient: it dominates the span."""
    linear = tables.coefficients.nearest("bias_temperature", 1e6, tables.guard)
    if linear is None or "unit_C" not in tables.residuals:
        return None
    read = tables.residuals["unit_C"]
    read = read[np.isfinite(read)]
    if not read.size or not np.ptp(read) > 0.0:
        return None
    theta = np.linspace(read.min(), read.max(), LEVELS) - REFERENCE_C
    curve, errors = np.zeros((3, LEVELS)), np.zeros(3)
    for power, effect in enumerate(EFFECTS, start=1):
        coefficients, spread, scale = tables.coefficients.lot.effect(effect, tables.coefficients.unit)
        if coefficients.shape[-1]:
            curve += 1e6 * (coefficients / scale)[:, :1] * theta**power
            errors = (1e6 * spread / scale)[:, 0] if power == 1 else errors
    spans = np.ptp(curve, axis=1) / np.ptp(read)
    worst = int(np.argmax(spans + tables.guard * errors))
    return Value(float(spans[worst]), float(errors[worst]))


FIGURE = FigureKind(
    name="thermal_stability_ug_K",
    unit="µg/K",
    label="thermal stability: span of the bias over that of the temperature, worst axis",
    order=82,
    value=_value,
    missing=effect_in_model("bias_temperature"),
)
