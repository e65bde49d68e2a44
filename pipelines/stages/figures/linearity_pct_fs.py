"""Linearity: largest deviation from the least-squares line over ±1 g, in % of the one-sided full scale, of the worst axis."""

from __future__ import annotations

import numpy as np

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, effect_in_model

ORDERS = {"second_order": 2, "third_order": 3, "fourth_order": 4, "fifth_order": 5}
POINTS = 2001


def _value(tables: UnitTables) -> Value | None:
    """From the nonlinear coefficients of the model; tumbling covers ±1 g only, and only this part of the range is judged."""
    own, lot = tables.coefficients, tables.coefficients.lot
    if not any(lot.effect(effect, own.unit)[0].shape[-1] for effect in ORDERS):
        return None
    force = np.linspace(-1.0, 1.0, POINTS)
    scale = lot.effect("scale", own.unit)[2]
    curve, variance = np.zeros((len(scale), POINTS)), np.zeros(len(scale))
    for effect, order in ORDERS.items():
        values, errors, scale = lot.effect(effect, own.unit)
        if values.shape[-1]:
            curve += (values / scale)[:, :1] * force**order
            variance += ((errors / scale)[:, 0] * _deviation(force**order)) ** 2
    full_scale = tables.full_scale / scale[:, 0]
    if not np.all(np.isfinite(full_scale)):
        return None
    deviations = 100.0 * np.array([_deviation(line) for line in curve]) / full_scale
    spread = 100.0 * np.sqrt(variance) / full_scale
    worst = int(np.argmax(deviations + tables.guard * spread))
    return Value(float(deviations[worst]), float(spread[worst]))


def _deviation(curve: np.ndarray) -> float:
    """Largest deviation of a curve over ±1 from its least-squares line."""
    force = np.linspace(-1.0, 1.0, curve.size)
    return float(np.max(np.abs(curve - np.polyval(np.polyfit(force, curve, 1), force))))


FIGURE = FigureKind(
    name="linearity_pct_FS",
    unit="%",
    label="deviation from the least-squares line over ±1 g, % of full scale, worst axis",
    order=75,
    value=_value,
    missing=effect_in_model("third_order"),
)
