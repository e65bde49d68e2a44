"""Figures of the coefficients of a calibrated unit: offset, misalignment, temperature, and deviations over a range."""

import numpy as np

from pipelines.stages.figures.base import FigureKind, UnitTables, Value, effect_in_model
from schemas.recipe import Recipe

ORDERS = {"second_order": 2, "third_order": 3, "fourth_order": 4, "fifth_order": 5}
POINTS = 2001
IN_TEMPERATURE = ("bias_temperature", "bias_temperature_quadratic", "bias_temperature_cubic")
REFERENCE_C = 25.0
LEVELS = 61


def _zero_g_offset(tables: UnitTables) -> Value | None:
    return tables.coefficients.nearest("bias", 1e3, tables.guard, nominal=tables.coefficients.lot.zero_g)


def _orthogonality(tables: UnitTables) -> Value | None:
    lot, unit = tables.coefficients
    angles = [lot.angle(unit, first, second) for first, second in ((0, 1), (1, 2), (2, 0))]
    values = [Value(1e3 * angle[0], 1e3 * angle[1]) for angle in angles if angle is not None]
    return max(values, key=lambda value: value.reach(tables.guard)) if values else None


def _three_axes(recipe: Recipe) -> str:
    return effect_in_model("misalignment")(recipe) or ("" if recipe.sensor_axes == 3 else "sensor_axes = 3")


def _linearity(tables: UnitTables) -> Value | None:
    """From the nonlinear coefficients of the model; tumbling covers ±1 g only, and only this part of the range is judged."""
    coefficients, lot = tables.coefficients, tables.coefficients.lot
    if not any(lot.effect(effect, coefficients.unit)[0].shape[-1] for effect in ORDERS):
        return None
    force = np.linspace(-1.0, 1.0, POINTS)
    scale = lot.effect("scale", coefficients.unit)[2]
    curve, variance = np.zeros((len(scale), POINTS)), np.zeros(len(scale))
    for effect, order in ORDERS.items():
        values, errors, scale = lot.effect(effect, coefficients.unit)
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


def _thermal_stability(tables: UnitTables) -> Value | None:
    """The uncertainty is that of the linear coefficient: it dominates the span."""
    linear = tables.coefficients.nearest("bias_temperature", 1e6, tables.guard)
    if linear is None or "unit_C" not in tables.residuals:
        return None
    read = tables.residuals["unit_C"]
    read = read[np.isfinite(read)]
    if not read.size or not np.ptp(read) > 0.0:
        return None
    theta = np.linspace(read.min(), read.max(), LEVELS) - REFERENCE_C
    curve, errors = np.zeros((1, LEVELS)), np.zeros(1)
    for power, effect in enumerate(IN_TEMPERATURE, start=1):
        coefficients, spread, scale = tables.coefficients.lot.effect(effect, tables.coefficients.unit)
        if coefficients.shape[-1]:
            curve = curve + 1e6 * (coefficients / scale)[:, :1] * theta**power
            errors = (1e6 * spread / scale)[:, 0] if power == 1 else errors
    spans = np.ptp(curve, axis=1) / np.ptp(read)
    worst = int(np.argmax(spans + tables.guard * errors))
    return Value(float(spans[worst]), float(errors[worst]))


FIGURES = (
    FigureKind(
        name="zero_g_offset_mg",
        unit="mg",
        meaning="Output at 0 g minus its nominal value, of the worst axis.",
        label="zero-g offset, worst axis",
        order=60,
        value=_zero_g_offset,
        missing=effect_in_model("bias"),
    ),
    FigureKind(
        name="misalignment_mrad",
        unit="mrad",
        meaning="Misalignment: the largest cross-axis coefficient over the scale factor, an angle.",
        label="misalignment, worst",
        order=70,
        value=lambda tables: tables.coefficients.nearest("misalignment", 1e3, tables.guard),
        missing=effect_in_model("misalignment"),
    ),
    FigureKind(
        name="orthogonality_mrad",
        unit="mrad",
        meaning="Deviation from 90° of the angle between two axes, the largest: independent of the seat in the fixture.",
        label="deviation of the angle between two axes from 90°, worst",
        order=72,
        value=_orthogonality,
        missing=_three_axes,
    ),
    FigureKind(
        name="linearity_pct_FS",
        unit="%",
        meaning="Linearity: largest deviation from the least-squares line over ±1 g, in % of the one-sided full scale, of the "
        "worst axis.",
        label="deviation from the least-squares line over ±1 g, % of full scale, worst axis",
        order=75,
        value=_linearity,
        missing=effect_in_model("third_order"),
    ),
    FigureKind(
        name="bias_temperature_ug_K",
        unit="µg/K",
        meaning="Change of the bias with temperature, of the worst axis.",
        label="bias over temperature, worst axis",
        order=80,
        value=lambda tables: tables.coefficients.nearest("bias_temperature", 1e6, tables.guard),
        missing=effect_in_model("bias_temperature"),
    ),
    FigureKind(
        name="thermal_stability_ug_K",
        unit="µg/K",
        meaning="Thermal stability: span of the fitted bias over the temperatures of the run, over their span, of the worst "
        "axis.",
        label="thermal stability: span of the bias over that of the temperature, worst axis",
        order=82,
        value=_thermal_stability,
        missing=effect_in_model("bias_temperature"),
    ),
    FigureKind(
        name="scale_temperature_ppm_K",
        unit="ppm/K",
        meaning="Change of the scale factor with temperature, of the worst axis.",
        label="scale over temperature, worst axis",
        order=90,
        value=lambda tables: tables.coefficients.nearest("scale_temperature", 1e6, tables.guard),
        missing=effect_in_model("scale_temperature"),
    ),
)
