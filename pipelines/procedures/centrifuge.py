"""Centrifuge: linearity in % of full scale, K2 and K3 over a = rω²/g, with the input reversed, at one radius or several."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.centrifuge import TERMS, Polynomial, columns, fit_polynomial
from inertial.dynamics.centrifuge_diagnosis import DEFAULT, SpinFit, diagnose_spins
from inertial.dynamics.centrifuge_effects import EFFECTS, Spins
from inertial.dynamics.missing_effects import DiagnosisInG
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.procedures.base import InG, NominalScale, OnEquipment, RecordByRecord, refuse_unknown_effects, scale_of
from pipelines.procedures.centrifuge_radii import (
    diagnosis_text,
    figures_of_radii,
    figures_of_radius,
    fitted_radii,
    of_radii,
    texts_of_radii,
    texts_of_radius,
)
from pipelines.procedures.figures import FigureSpec, UnitOutcome
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureStep, Taken, numbers, on_equipment
from schemas.bounds import NotNegative, Positive
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import StationConfig
from stations.profile_files import profile_of

INPUT = 2  # the input axis is z, radial
CLOSEST = 1.02  # ratio of two radii

OF_REFERENCE = ("reference_ppm", "reference_linearity_ppm")
"""What is to be known of a reference sensor."""


class CentrifugePart(NominalScale):
    """Speeds up and down again, with the units mounted one way and reversed.

    ``effects`` is the model to be judged; the diagnosis names what is missing. ``radius_m`` is the nominal radius to the proof
    mass and ``radius_um`` its standard uncertainty: with one radius it is the sensitivity's, in full. ``point_ppm`` is the
    standard uncertainty of the acceleration of one point by the rate and its trend, independent from point to point.

    ``reference_radius_m`` is the radius to a reference sensor on the arm. With it the acceleration is the reading of this sensor
    times ``radius_m`` over ``reference_radius_m``. ``reference_ppm`` is the standard uncertainty of its scale, which is the
    sensitivity's in full; ``reference_linearity_ppm`` that of its departure from a straight line, in ppm of the reading: it is in
    the uncertainty of every point, as independent from point to point. The unit's K2, K3 and Koq also hold those of the sensor.
    """

    kind: Literal["centrifuge"]
    forces_g: Annotated[list[Positive], Field(min_length=4, max_length=50)] = Field(
        default_factory=lambda: [1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]
    )
    down_again: bool = True
    reversed: bool = True
    radius_m: Positive = 0.5
    radii_m: Annotated[list[Positive], Field(min_length=2, max_length=4)] | None = None
    radius_um: NotNegative = 20.0
    reference_radius_m: Positive | None = None
    reference_ppm: NotNegative | None = None
    reference_linearity_ppm: NotNegative | None = None
    point_ppm: NotNegative = 2.0
    record_s: Annotated[Positive, Field(le=600.0)] = 5.0
    full_scale_g: Positive = 30.0
    effects: Annotated[list[str], Field(max_length=6)] = Field(default_factory=lambda: list(DEFAULT))

    @model_validator(mode="after")
    def _known(self) -> Self:
        refuse_unknown_effects(self.effects, EFFECTS, "centrifuges")
        alone = [key for key in OF_REFERENCE if getattr(self, key) is not None]
        if alone and self.reference_radius_m is None:
            raise ValueError(
                f"{alone[0]}: given without reference_radius_m, which is needed; add the radius to the reference sensor, or "
                f"leave {' and '.join(alone)} out"
            )
        if self.reference_radius_m is not None:
            for key in OF_REFERENCE:
                if getattr(self, key) is None:
                    raise ValueError(
                        f"{key}: not given beside reference_radius_m, which needs it; add it, from the sensor's certificate"
                    )
        if self.radii_m is None:
            return self
        if self.reference_radius_m is not None:
            raise ValueError("reference_radius_m: for one radius, radii_m has several; leave one of them out")
        if "radius_m" in self.model_fields_set:
            raise ValueError("radius_m and radii_m are both given, one of them is needed; leave radius_m out")
        if min(b / a for a, b in pairwise(sorted(self.radii_m))) < CLOSEST:
            raise ValueError(
                f"radii_m: radii closer than {100.0 * (CLOSEST - 1.0):g} % separate nothing; choose them further apart"
            )
        if self.radius_um <= 0.0:
            raise ValueError("radius_um: 0 µm for several radii, their uncertainty is needed; state radius_um")
        return self

    @property
    def radii(self) -> tuple[float, ...]:
        """The radii of the test in order, m."""
        return (self.radius_m,) if self.radii_m is None else tuple(self.radii_m)


class CentrifugeTest(InG, OnEquipment, RecordByRecord):
    """Constant speeds on a centrifuge."""

    title = "Centrifuge"
    order = 130
    states = (
        "linearity in % of full scale, K2, K3, sensitivity by the radius; at two radii also the offset of the proof mass, "
        "parted from K1′, and arm stretch, parted from Koq"
    )
    source = "IEEE Std 836 (centrifuge), IEEE Std 1293"
    roles = ("centrifuge",)
    part = CentrifugePart
    figures = (
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
        FigureSpec(
            "centrifuge_mass_offset_um", "µm", "offset of the proof mass from the turning centre, outwards; two radii"
        ),
        FigureSpec(
            "centrifuge_radius_consistency_ppm",
            "ppm",
            "sensitivity by a further radius over that by the first, minus 1; two radii and both mountings",
        ),
    )

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse several radii on a centrifuge that cannot be told the radius, and a part without a scale."""
        super().check(part, recipe, station)
        if part.radii_m is not None and not profile_of(station.fitted()["centrifuge"]).has("radius"):
            raise RecipeInvalid(
                f"recipe: procedure centrifuge: radii_m has {len(part.radii)} radii, the centrifuge of station {station.name} "
                "has no command 'radius' in its profile; add it, or give radius_m",
                key="radii_m",
            )

    def steps(self, part: CentrifugePart, recipe: Recipe) -> list[ProcedureStep]:
        """One record at each speed: up, down again, then the same with the units reversed, and all at the next radius."""
        way = [*part.forces_g, *(part.forces_g[-2::-1] if part.down_again else ())]
        return [
            on_equipment(
                "centrifuge",
                f"{'+' if sign > 0 else '−'}{force:g} g" + (f" at {radius:g} m" if part.radii_m else ""),
                part,
                part.record_s + 10.0,
                {"force_g": force, "direction": sign, "radius_m": radius, "record_s": part.record_s},
            )
            for radius in part.radii
            for sign in ((1.0, -1.0) if part.reversed else (1.0,))
            for force in way
        ]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording at a constant speed of the arm."""
        setting = step.setting
        rate = math.degrees(math.sqrt(setting["force_g"] * 9.80665 / setting["radius_m"]))
        return equipment.spin(rate, int(setting["direction"]), setting["record_s"], slots, setting["radius_m"])

    def points(self, part: CentrifugePart, taken: Taken, device: Device) -> Iterator[dict[str, Any]]:
        """Mean output in g over the acceleration by the measured rate."""
        read = taken.record.samples[REFERENCE].output
        rate = np.radians(read[:, 0].mean())
        radius, way = (taken.record.step.setting[name] for name in ("radius_m", "direction"))
        by_rate = force = way * radius * rate**2 / 9.80665
        common = 1e-6 * part.point_ppm * abs(force)
        if part.reference_radius_m is not None:
            ratio = way * radius / part.reference_radius_m
            force, scatter = ratio * float(read[:, 1].mean()), float(read[:, 1].std(ddof=1)) / np.sqrt(len(read))
            linearity = 1e-6 * (part.reference_linearity_ppm or 0.0) * abs(force)
            common = math.hypot(common, linearity, abs(ratio) * scatter)
        axis = INPUT if len(taken.samples.letters) > INPUT else 0  # a device without z is mounted by its x
        raw = taken.samples.output[:, axis]
        output = raw / scale_of(part, device, taken.unit)[axis]
        clipped = device.at_end(raw) > 0
        error = float(np.hypot(output.std(ddof=1) / np.sqrt(output.size), common))
        yield {
            "unit": taken.unit, "axis": taken.samples.letters[axis], "series": "output", "point": taken.number,
            "setting": float(force), "value": np.nan if clipped else float(output.mean()), "uncertainty": error,
            "spread": float(output.std(ddof=1)), "radius_m": radius, "by_rate": float(by_rate),
        }  # fmt: skip

    def of_unit(self, part: CentrifugePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Coefficients; the whole polynomial where the input is reversed."""
        axis = str(rows["axis"].iloc[0])
        lost = int(rows["value"].isna().sum())
        if lost:
            raise NotIdentified(
                f"{lost} of {len(rows)} speeds clip the output; lower forces_g, or choose a wider range"
            )
        if bool((rows["spread"] <= 0.0).any()):
            raise NotIdentified("the output is constant; check the unit")
        force, value = numbers(rows, "setting", "value")
        ratio = force / numbers(rows, "by_rate")[0] if part.reference_radius_m is not None else np.ones(1)
        if not np.all((ratio > 0.5) & (ratio < 2.0)):
            raise NotIdentified(
                f"the reference sensor on the arm reads {100.0 * ratio.min():.3g} to {100.0 * ratio.max():.3g} % of rω²; check "
                "its cable, and reference_radius_m"
            )
        if float(np.corrcoef(force, value)[0, 1] ** 2) < 0.5:  # share of the variance that the acceleration explains
            raise NotIdentified("the output does not follow the acceleration; check cable and mounting")
        if part.radii_m:
            radii = fitted_radii(rows, 1e-6 * part.radius_um)
            figures, texts = figures_of_radii(radii, axis, part.full_scale_g), texts_of_radii(radii, part.radii)
        else:
            fit = fitted(part, rows)
            of_sensor = 0.0 if part.reference_radius_m is None else (part.reference_ppm or 0.0) * part.radius_m
            radius_error = 1e-6 * float(np.hypot(part.radius_um, of_sensor))
            figures = figures_of_radius(fit, axis, part.full_scale_g, part.radius_m, radius_error)
            texts = texts_of_radius(fit, part.radius_m, both=part.reversed)
            if part.reference_radius_m is not None:
                ends = f"{1e6 * (ratio.min() - 1.0):+.4g} to {1e6 * (ratio.max() - 1.0):+.4g} ppm"
                texts = [
                    *texts,
                    (
                        "reference sensor",
                        f"reads {ends} beside rω²; U of its reading {2.0 * (part.reference_ppm or 0.0):g} ppm",
                    ),
                ]
        diagnosis = judged(part, rows)
        if diagnosis.alone:  # coefficients would follow the bad point
            figures = self.nothing(part, "; ".join(diagnosis.next_steps[: len(diagnosis.alone)]), axis)
        return figures, [*texts, *diagnosis_text(diagnosis)]

    def chart(self, part: CentrifugePart, points: pd.DataFrame) -> Chart:
        """Departure from the straight line over the acceleration, with the polynomial; each radius has its line."""
        if part.radii_m:
            traces = of_radii(points, 1e-6 * part.radius_um)
        else:
            force, value, error = numbers(points)
            line, fit = np.polyfit(force, value, 1), fitted(part, points)
            shown, expanded = 1e3 * (value - np.polyval(line, force)), 2e3 * error
            x = np.linspace(force.min(), force.max(), 300)
            curve = columns(x, fit.names) @ fit.value - np.polyval(line, x)
            traces = [
                Trace("measured, U (k = 2)", force, shown, error=expanded),
                Trace("polynomial", x, 1e3 * curve, "line", "before"),
            ]
        axes = PlotAxis("acceleration / g"), PlotAxis("departure from the straight line / mg")
        return Chart(self.title, (Plot("", *axes, tuple(traces)),))


def fitted(part: CentrifugePart, rows: pd.DataFrame) -> Polynomial:
    """The terms of the fit: all with the input reversed; without it the four that one direction separates."""
    force, value, error = numbers(rows)
    return fit_polynomial(force, value, error, TERMS if part.reversed else TERMS[:4])


def judged(part: CentrifugePart, rows: pd.DataFrame) -> DiagnosisInG[SpinFit]:
    """The diagnosis of the part's model on the points of one unit."""
    force, value, error = numbers(rows)
    radius = rows["radius_m"].to_numpy(dtype=float) if part.radii_m else np.full(force.size, part.radius_m)
    same = (force[1:] * force[:-1] > 0.0) & (radius[1:] == radius[:-1])
    slowing = np.r_[0.0, (np.diff(np.abs(force)) < 0.0) & same].astype(float)
    spins = Spins(force, radius, np.linspace(0.0, 1.0, force.size), slowing, 1e-6 * part.radius_um)
    return diagnose_spins(spins, value, error, part.effects)


PROCEDURE = CentrifugeTest()
