"""Figures and findings of a centrifuge test at one radius, and its diagnosis in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

from inertial.dynamics.centrifuge import Polynomial
from inertial.dynamics.centrifuge_effects import EFFECTS
from inertial.dynamics.goodness import p_value
from pipelines.procedures.centrifuge_radii import OF_RADII, ONE_RADIUS, figures_of_polynomial
from pipelines.procedures.figures import FigureValue
from pipelines.procedures.wording import improvement, not_separated, probability, verdict_of, with_uncertainty
from schemas.units import MICRO

if TYPE_CHECKING:
    from inertial.dynamics.centrifuge_diagnosis import SpinDiagnosis


def figures_of_radius(
    fit: Polynomial, full_scale_g: float, radius_m: float, radius_error_m: float
) -> list[FigureValue]:
    """Figures of a unit at one radius; those that need two are not determined."""
    return [
        *figures_of_polynomial(fit, full_scale_g, 100.0 * radius_error_m / radius_m),
        *(FigureValue.not_determined(name, "z", ONE_RADIUS) for name in OF_RADII),
    ]


def texts_of_radius(fit: Polynomial, radius_m: float, *, both: bool) -> list[tuple[str, str]]:
    """Verdict on the polynomial at one radius, and the classes of effects that it holds: subject and text."""
    out = [("model", f"polynomial {' + '.join(fit.names)} {verdict_of(fit)}")]
    if not both:
        text = (
            "arm stretch, Koq and the offset of the proof mass cannot be separated from K2, K3 and bias; "
            "measure with the units reversed"
        )
        return [*out, ("not determined", text)]
    for name, text in (
        (
            "arm_stretch_or_odd_quadratic",
            "arm stretch or Koq, one class: two radii (radii_m) or the optical radius at speed separate them",
        ),
        (
            "mass_offset_or_asymmetry",
            "offset of the proof mass from the turning centre, or K1′, one class: two radii (radii_m) separate them",
        ),
    ):
        value, error = fit.of(name)
        if abs(value) > 4.0 * error:
            factor = 1e3 * radius_m if name.startswith("mass") else MICRO
            unit = "mm of offset" if name.startswith("mass") else "µg/g²"
            out.append(
                ("effect found", f"{text}: {with_uncertainty(factor * value, 2.0 * factor * error)} {unit} (k = 2)")
            )
    return out


def diagnosis_text(diagnosis: SpinDiagnosis) -> list[tuple[str, str]]:
    """The diagnosis in sentences: subject and text."""
    model = " + ".join(("bias", "scale", *diagnosis.fit.effects))
    if diagnosis.adequate is None:
        return [("diagnosis", f"{model} cannot be judged: {diagnosis.reason}")]
    verdict = "adequate" if diagnosis.adequate else "not adequate"
    text = (
        f"{model} is {verdict} ({probability(p_value(diagnosis.fit))}), rms residual {MICRO * diagnosis.error_g:.3g} µg"
    )
    out = [("diagnosis", text)]
    for one in diagnosis.classes:
        name = one.effects[0]
        value, error = diagnosis.extended.of(name)
        rivals = not_separated(one.effects, "the points")
        size = f"{with_uncertainty(value, 2.0 * error)} {EFFECTS[name].unit} (k = 2)"
        out.append(("missing effect", f"{name}: {size}, {probability(one.p_value)}{rivals}"))
    if diagnosis.classes:
        errors = (f"{MICRO * diagnosis.error_g:.3g}", f"{MICRO * diagnosis.extended_g:.3g} µg")
        text = improvement(*errors, "points", diagnosis.left_out)
        out.append(("with the missing effects", text))
    if diagnosis.unexplained:
        out.append(("unexplained", "no known effect explains the residual; look at it over the acceleration"))
    return [*out, *(("next measurement", step) for step in diagnosis.next_steps)]
