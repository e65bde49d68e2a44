"""Centrifuge: linearity in % of full scale, K2 and K3 over a = rω²/g, with the input reversed."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.stats import chi2

from inertial.counts import degrees_of_freedom
from inertial.dynamics.centrifuge import TERMS, Polynomial, columns, fit_polynomial, linearity_error, linearity_percent
from inertial.dynamics.centrifuge_diagnosis import DEFAULT, SpinDiagnosis, diagnose_spins
from inertial.dynamics.centrifuge_effects import EFFECTS, Spins
from inertial.errors import NotIdentified
from pipelines.procedures.base import (
    REFERENCE,
    Device,
    Evaluated,
    FigureSpec,
    FigureValue,
    Finding,
    InG,
    NominalScale,
    OnEquipment,
    Outcome,
    Part,
    ProcedureRecord,
    ProcedureStep,
    refuse_unknown_effects,
    scale_of,
)
from pipelines.procedures.columns import points as point_table
from pipelines.procedures.wording import probability, with_uncertainty
from schemas.bounds import NotNegative, Positive
from schemas.recipe import Pose
from schemas.units import MICRO

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.figure import Figure as Drawing

    from schemas.recipe import Recipe

INPUT = 2  # the input axis is z, radial


class CentrifugePart(NominalScale):
    """Speeds up and down again, with the units mounted one way and reversed.

    ``effects`` is the model to be judged; the diagnosis names what is missing. ``radius_m`` is the nominal radius to the proof
    mass and ``radius_um`` its standard uncertainty: with one radius it is the sensitivity's, in full. ``point_ppm`` is the
    standard uncertainty of a point's acceleration besides (rate, trend), of itself.
    """

    kind: Literal["centrifuge"]
    forces_g: Annotated[list[Positive], Field(min_length=4, max_length=50)] = Field(
        default_factory=lambda: [1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]
    )
    down_again: bool = True
    reversed: bool = True
    radius_m: Positive = 0.5
    radius_um: NotNegative = 20.0
    point_ppm: NotNegative = 2.0
    record_s: Annotated[Positive, Field(le=600.0)] = 5.0
    full_scale_g: Positive = 30.0
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0
    effects: Annotated[list[str], Field(max_length=6)] = Field(default_factory=lambda: list(DEFAULT))

    @model_validator(mode="after")
    def _known(self) -> CentrifugePart:
        refuse_unknown_effects(self.effects, EFFECTS, "centrifuges")
        return self


class CentrifugeTest(InG, OnEquipment, Evaluated):
    """Constant speeds on a centrifuge."""

    name: ClassVar[str] = "centrifuge"
    title: ClassVar[str] = "Centrifuge"
    order: ClassVar[int] = 130
    states: ClassVar[str] = (
        "linearity in % of full scale, K2, K3, sensitivity by the radius; arm stretch against Koq as one class"
    )
    source: ClassVar[str] = "IEEE Std 836 (centrifuge), IEEE Std 1293"
    roles: ClassVar[tuple[str, ...]] = ("centrifuge",)
    part: ClassVar[type[Part]] = CentrifugePart
    figures: ClassVar[tuple[FigureSpec, ...]] = (
        FigureSpec(
            "centrifuge_linearity_percent",
            "%",
            "largest departure from the least-squares line over ± full scale, of the one-sided range",
        ),
        FigureSpec("centrifuge_second_order_ug_g2", "µg/g²", "K2"),
        FigureSpec("centrifuge_third_order_ug_g3", "µg/g³", "K3"),
        FigureSpec(
            "centrifuge_sensitivity_percent",
            "%",
            "departure of the sensitivity from the static or nominal scale; the radius' uncertainty is its own",
        ),
    )

    def steps(self, part: CentrifugePart, recipe: Recipe) -> list[ProcedureStep]:
        """One record at each speed: up, down again, then the same with the units reversed."""
        del recipe
        way = [*part.forces_g, *(part.forces_g[-2::-1] if part.down_again else ())]
        pose = Pose(name="centrifuge", outer_deg=0.0, inner_deg=0.0)
        return [
            ProcedureStep(
                f"{'+' if sign > 0 else '−'}{force:g} g",
                pose,
                part.temperature_C,
                lasting_s=part.record_s + 10.0,
                role="centrifuge",
                setting={"force_g": force, "direction": sign, "radius_m": part.radius_m, "record_s": part.record_s},
            )
            for sign in ((1.0, -1.0) if part.reversed else (1.0,))
            for force in way
        ]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """One constant speed."""
        one = step.setting
        rate = math.degrees(math.sqrt(one["force_g"] * 9.80665 / one["radius_m"]))
        return equipment.spin(rate, int(one["direction"]), one["record_s"], slots)

    def reduce(self, part: CentrifugePart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Mean output in g over the acceleration by the measured rate."""
        rows: list[dict[str, Any]] = []
        for k, record in enumerate(records):
            rate = np.radians(record.samples[REFERENCE].output[:, 0].mean())
            force = record.step.setting["direction"] * part.radius_m * rate**2 / 9.80665
            for unit, _, own in record.by_unit():
                raw = own.output[:, INPUT]
                output = raw / scale_of(part, device, unit)[INPUT]
                clipped = bool(np.max(np.abs(raw)) >= device.full_scale)
                error = float(np.hypot(output.std(ddof=1) / np.sqrt(output.size), 1e-6 * part.point_ppm * abs(force)))
                rows.append(
                    {
                        "unit": unit, "axis": "z", "series": "output", "point": k, "setting": float(force),
                        "value": np.nan if clipped else float(output.mean()), "uncertainty": error,
                        "spread": float(output.std(ddof=1)),
                    }
                )  # fmt: skip
        return point_table(rows)

    def evaluate(self, part: CentrifugePart, points: pd.DataFrame, device: Device) -> Outcome:
        """Coefficients of every unit; the whole polynomial where the input is reversed."""
        del device
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        for unit, rows in points.groupby("unit", sort=False):
            name = str(unit)
            note = ""
            if bool(rows["value"].isna().any()):
                note = (
                    f"{int(rows['value'].isna().sum())} of {len(rows)} speeds clip the output; lower "
                    f"forces_g, or choose a wider range"
                )
            elif bool((rows["spread"] <= 0.0).any()):
                note = "the output is constant; check the unit"
            elif _responds(rows) < 0.5:
                note = "the output does not follow the acceleration; check cable and mounting"
            if note:
                figures[name] = [FigureValue.not_determined(f.name, "z", note) for f in self.figures]
                continue
            try:
                fit = fitted(part, rows)
            except NotIdentified as problem:
                figures[name] = [FigureValue.not_determined(f.name, "z", str(problem)) for f in self.figures]
                continue
            figures[name] = _figures(part, fit)
            texts = [*_texts(part, fit), *diagnosis_text(judged(part, rows))]
            findings += [Finding(name, subject, text) for subject, text in texts]
        return Outcome(figures, findings)

    def draw(self, drawing: Drawing, part: CentrifugePart, points: pd.DataFrame) -> None:
        """Departure from the straight line over the acceleration, with the polynomial."""
        place = drawing.subplots()
        force, value = points["setting"].to_numpy(dtype=float), points["value"].to_numpy(dtype=float)
        line = np.polyfit(force, value, 1)
        place.errorbar(
            force,
            1e3 * (value - np.polyval(line, force)),
            2e3 * points["uncertainty"],
            fmt="o",
            ms=3.5,
            lw=0.9,
            c="#0072b2",
            label="measured, U (k = 2)",
        )
        fit = fitted(part, points)
        x = np.linspace(force.min(), force.max(), 300)
        place.plot(
            x, 1e3 * (columns(x, fit.names) @ fit.value - np.polyval(line, x)), lw=1.1, c="#d55e00", label="polynomial"
        )
        place.set(xlabel="acceleration / g", ylabel="departure from the straight line / mg")
        place.legend(frameon=False)


def fitted(part: CentrifugePart, rows: pd.DataFrame) -> Polynomial:
    """All terms with the input reversed; without it the four that one direction separates."""
    force, value, error = (rows[name].to_numpy(dtype=float) for name in ("setting", "value", "uncertainty"))
    return fit_polynomial(force, value, error, TERMS if part.reversed else TERMS[:4])


def judged(part: CentrifugePart, rows: pd.DataFrame) -> SpinDiagnosis:
    """The diagnosis of the part's model on the points of one unit."""
    force, value, error = (rows[name].to_numpy(dtype=float) for name in ("setting", "value", "uncertainty"))
    slowing = np.r_[0.0, (np.diff(np.abs(force)) < 0.0) & (force[1:] * force[:-1] > 0.0)].astype(float)
    spins = Spins(force, np.full(force.size, part.radius_m), np.linspace(0.0, 1.0, force.size), slowing)
    return diagnose_spins(spins, value, error, part.effects)


def diagnosis_text(found: SpinDiagnosis) -> list[tuple[str, str]]:
    """The diagnosis in sentences: subject and text."""
    model = " + ".join(("bias", "scale", *found.fit.effects))
    if found.adequate is None:
        return [("diagnosis", f"{model} cannot be judged: {found.reason}")]
    p = float(chi2.sf(found.fit.chi_square, found.fit.dof))
    verdict = "adequate" if found.adequate else "not adequate"
    text = f"{model} is {verdict} ({probability(p)}), rms residual {MICRO * found.error_g:.3g} µg"
    out = [("diagnosis", text)]
    for one in found.classes:
        name = one.effects[0]
        value, error = found.extended.of(name)
        rivals = f"; the points do not separate it from {', '.join(one.effects[1:])}" if len(one.effects) > 1 else ""
        size = f"{with_uncertainty(value, 2.0 * error)} {EFFECTS[name].unit} (k = 2)"
        out.append(("missing effect", f"{name}: {size}, {probability(one.p_value)}{rivals}"))
    if found.classes:
        text = (
            f"rms residual {MICRO * found.error_g:.3g} → {MICRO * found.extended_g:.3g} µg; points left out, in standard "
            f"uncertainties: {found.left_out[0]:.2f} → {found.left_out[1]:.2f}"
        )
        out.append(("with the missing effects", text))
    if found.unexplained:
        out.append(("unexplained", "no known effect explains the residual; look at it over the acceleration"))
    return [*out, *(("next measurement", step) for step in found.next_steps)]


def _responds(rows: pd.DataFrame) -> float:
    """Share of the output's variance that the acceleration explains."""
    force, value = rows["setting"].to_numpy(dtype=float), rows["value"].to_numpy(dtype=float)
    return float(np.corrcoef(force, value)[0, 1] ** 2)


def _figures(part: CentrifugePart, fit: Polynomial) -> list[FigureValue]:
    linearity = linearity_percent(fit, part.full_scale_g)
    spread = linearity_error(fit, part.full_scale_g)
    k2, k3, k1 = fit.of("second_order"), fit.of("third_order"), fit.of("scale")
    radius = 1e-4 * part.radius_um / part.radius_m  # %
    return [
        FigureValue("centrifuge_linearity_percent", "z", linearity, spread),
        FigureValue("centrifuge_second_order_ug_g2", "z", MICRO * k2[0], MICRO * k2[1]),
        FigureValue("centrifuge_third_order_ug_g3", "z", MICRO * k3[0], MICRO * k3[1]),
        FigureValue(
            "centrifuge_sensitivity_percent", "z", 100.0 * (k1[0] - 1.0), float(np.hypot(100.0 * k1[1], radius))
        ),
    ]


def _texts(part: CentrifugePart, fit: Polynomial) -> list[tuple[str, str]]:
    p = float(chi2.sf(fit.chi_square, fit.dof)) if fit.dof > 0 else float("nan")
    verdict = "cannot be judged" if not np.isfinite(p) else "adequate" if p >= 0.005 else "not adequate"
    judged_by = f"χ² {fit.chi_square:.1f} for {degrees_of_freedom(fit.dof)}, {probability(p)}"
    out = [("model", f"polynomial {' + '.join(fit.names)} is {verdict}: {judged_by}")]
    if not part.reversed:
        text = (
            "arm stretch, Koq and the offset of the proof mass cannot be separated from K2, K3 and bias; "
            "measure with the units reversed"
        )
        return [*out, ("not determined", text)]
    for name, text in (
        (
            "arm_stretch_or_odd_quadratic",
            "arm stretch or Koq, one class: separate them by the optical radius at speed",
        ),
        (
            "mass_offset_or_asymmetry",
            "offset of the proof mass from the turning centre, or a scale that differs by sign, one class",
        ),
    ):
        value, error = fit.of(name)
        if abs(value) > 4.0 * error:
            factor = 1e3 * part.radius_m if name.startswith("mass") else MICRO
            unit = "mm of offset" if name.startswith("mass") else "µg/g²"
            out.append(
                ("effect found", f"{text}: {with_uncertainty(factor * value, 2.0 * factor * error)} {unit} (k = 2)")
            )
    return out


PROCEDURE = CentrifugeTest()
