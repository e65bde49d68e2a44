"""Figures, findings and picture of a centrifuge test at one radius or several, and its diagnosis in sentences."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics.centrifuge import (
    STANDARD_GRAVITY,
    Polynomial,
    RadiiFit,
    columns,
    fit_radii,
    linearity_error,
    linearity_percent,
)
from inertial.dynamics.centrifuge_diagnosis import SpinFit
from inertial.dynamics.centrifuge_effects import EFFECTS
from inertial.dynamics.missing_effects import DiagnosisInG
from pipelines.drawing.chart import SEVERAL, Trace
from pipelines.procedures.figures import FigureValue, diagnosis_texts, verdict_of, with_uncertainty
from pipelines.procedures.recorded import numbers
from schemas.units import MICRO

OF_RADII = ("centrifuge_mass_offset_um", "centrifuge_radius_consistency_ppm")
"""Figures that one radius cannot determine."""
ONE_RADIUS = "one radius: the offset is not parted from a scale that differs by sign; list two radii in radii_m"
ONE_MOUNTING = "one mounting: errors of the radii are not parted from the offset; measure with the units reversed"


def fitted_radii(rows: pd.DataFrame, radius_error_m: float) -> RadiiFit:
    """The fit over all radii of the points of one unit; :class:`inertial.errors.NotIdentified` as there."""
    force, value, error, radius = numbers(rows, "setting", "value", "uncertainty", "radius_m")
    return fit_radii(force, radius, value, error, radius_error_m)


def figures_of_polynomial(
    fit: Polynomial, axis: str, full_scale_g: float, radius_percent: float = 0.0
) -> list[FigureValue]:
    """Linearity, K2, K3 and sensitivity; ``radius_percent`` is the uncertainty of a single radius."""
    k1, k2, k3 = (fit.of(name) for name in ("scale", "second_order", "third_order"))
    linearity, error = linearity_percent(fit, full_scale_g), linearity_error(fit, full_scale_g)
    spread = float(np.hypot(100.0 * k1[1], radius_percent))
    return [
        FigureValue("centrifuge_linearity_percent", axis, linearity, error),
        FigureValue("centrifuge_second_order_ug_g2", axis, MICRO * k2[0], MICRO * k2[1]),
        FigureValue("centrifuge_third_order_ug_g3", axis, MICRO * k3[0], MICRO * k3[1]),
        FigureValue("centrifuge_sensitivity_percent", axis, 100.0 * (k1[0] - 1.0), spread),
    ]


def figures_of_radii(fit: RadiiFit, axis: str, full_scale_g: float) -> list[FigureValue]:
    """The figures: linearity, K2, K3 and sensitivity are the unit's own, without arm and mounting."""
    mass, consistency = OF_RADII
    offset, spread = fit.mass_offset_m
    figures = [
        *figures_of_polynomial(fit.unit, axis, full_scale_g),
        FigureValue(mass, axis, MICRO * offset, MICRO * spread),
    ]
    if fit.consistency is None:
        return [*figures, FigureValue.not_determined(consistency, axis, ONE_MOUNTING)]
    value, error = fit.consistency
    return [*figures, FigureValue(consistency, axis, MICRO * value, MICRO * error)]


def texts_of_radii(fit: RadiiFit, radii: Sequence[float]) -> list[tuple[str, str]]:
    """Verdict on the whole model, and each parameter that one radius leaves open: subject and text."""
    unit = fit.unit
    terms = " + ".join((*unit.names, "arm_stretch", "mass_offset"))
    out = [
        ("model", f"{terms}, with the errors of {len(radii)} radii, {verdict_of(unit)}"),
        ("offset of the proof mass", f"{_stated(fit.mass_offset_m, MICRO)} µm (k = 2), the same at every radius"),
        ("arm stretch", f"{_stated(fit.arm_stretch_s2, 1e9)} · 10⁻⁹ s² (k = 2), κ of r = r₀(1 + κω²)"),
    ]
    if "asymmetry" in unit.names:
        out += [
            ("K1′", f"{_stated(unit.of('asymmetry'), MICRO)} ppm (k = 2), scale that differs by sign"),
            ("Koq", f"{_stated(unit.of('odd_quadratic'), MICRO)} µg/g² (k = 2)"),
        ]
    else:
        out.append(("not determined", "K1′ is in the sensitivity and Koq in K2; measure with the units reversed"))
    each = ", ".join(
        f"{radius:g} m {_stated(error, MICRO)} µm"
        for radius, error in zip(sorted(radii, reverse=True), fit.radius_errors_m, strict=True)
    )
    return [*out, ("errors of the radii", f"{each} (k = 2), by outputs and stated uncertainty together")]


def _stated(estimate: tuple[float, float], factor: float) -> str:
    return with_uncertainty(factor * estimate[0], 2.0 * factor * estimate[1])


def of_radii(points: pd.DataFrame, radius_error_m: float) -> list[Trace]:
    """Departure from a straight line for each radius: with offset and stretch it differs from radius to radius."""
    fit = fitted_radii(points, radius_error_m)
    traces: list[Trace] = []
    for role, (radius, rows) in zip(SEVERAL, points.groupby("radius_m", sort=False), strict=False):
        force, value, error = numbers(rows)
        line, r = np.polyfit(force, value, 1), float(str(radius))
        apart, expanded = 1e3 * (value - np.polyval(line, force)), 2e3 * error
        traces.append(Trace(f"{r:g} m, U (k = 2)", force, apart, role=role, error=expanded))
        x = np.linspace(force.min(), force.max(), 301)
        traces.append(Trace(f"{r:g} m, fitted", x, 1e3 * _apart(fit, x, r, force), "line", role, legend=False))
    return traces


def _apart(fit: RadiiFit, x: Any, radius: float, force: Any) -> Any:
    """The fitted curve at a radius minus its own straight line over the measured accelerations (n,)."""

    def curve(a: Any) -> Any:
        scale = fit.unit.of("scale")[0]
        arm = fit.mass_offset_m[0] * np.abs(a) + fit.arm_stretch_s2[0] * STANDARD_GRAVITY * a * np.abs(a)
        return columns(a, fit.unit.names) @ fit.unit.value + scale * arm / radius

    return curve(x) - np.polyval(np.polyfit(force, curve(force), 1), x)


def figures_of_radius(
    fit: Polynomial, axis: str, full_scale_g: float, radius_m: float, radius_error_m: float
) -> list[FigureValue]:
    """Figures of a unit at one radius; those that need two are not determined."""
    return [
        *figures_of_polynomial(fit, axis, full_scale_g, 100.0 * radius_error_m / radius_m),
        *(FigureValue.not_determined(name, axis, ONE_RADIUS) for name in OF_RADII),
    ]


def texts_of_radius(fit: Polynomial, radius_m: float, *, both: bool) -> list[tuple[str, str]]:
    """Verdict on the polynomial at one radius, and the classes of effects that it holds: subject and text."""
    out = [("model", f"polynomial {' + '.join(fit.names)} {verdict_of(fit)}")]
    if not both:
        open_ = "arm stretch, Koq and the offset of the proof mass cannot be separated from K2, K3 and bias"
        return [*out, ("not determined", f"{open_}; measure with the units reversed")]
    stretch = "arm stretch or Koq, one class: two radii (radii_m) or the optical radius at speed separate them"
    offset = "offset of the proof mass from the turning centre, or K1′, one class: two radii (radii_m) separate them"
    for name, text, factor, unit in (
        ("arm_stretch_or_odd_quadratic", stretch, MICRO, "µg/g²"),
        ("mass_offset_or_asymmetry", offset, 1e3 * radius_m, "mm of offset"),
    ):
        value, error = fit.of(name)
        if abs(value) > 4.0 * error:
            out.append(("effect found", f"{text}: {_stated((value, error), factor)} {unit} (k = 2)"))
    return out


def diagnosis_text(diagnosis: DiagnosisInG[SpinFit]) -> list[tuple[str, str]]:
    """The diagnosis in sentences: subject and text."""

    def size(name: str) -> str:
        value, error = diagnosis.extended.of(name)
        return f"{with_uncertainty(value, 2.0 * error)} {EFFECTS[name].unit} (k = 2)"

    rms = (f"{MICRO * diagnosis.error_g:.3g}", f"{MICRO * diagnosis.extended_g:.3g}", "µg")
    unexplained = "the residual; look at it over the acceleration"
    return diagnosis_texts(diagnosis, "diagnosis", ("bias", "scale"), size, rms, ("points", "the points"), unexplained)
