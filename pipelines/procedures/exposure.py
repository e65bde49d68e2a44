"""Shift of bias and scale by cycles of temperature: six poses, the cycles, the same poses again."""

from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.arrays import Array
from inertial.dynamics.exposure import exposure_shift, temperature_slope
from inertial.dynamics.stability import error_of_mean, short_noise
from inertial.errors import NotIdentified
from inertial.frames import force_from_angles
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, level
from pipelines.procedures.base import InG, NominalScale, RecordByRecord, scale_of
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, worst
from pipelines.procedures.recorded import (
    Device,
    ProcedureStep,
    Taken,
    noise_columns,
    numbers,
    point_rows,
    pooled_noise,
)  # fmt: skip
from schemas.bounds import Positive
from schemas.errors import RecipeInvalid
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import AXES, MICRO, axes_among

BIAS, SCALE = "exposure_bias_shift_ug", "exposure_scale_shift_ppm"
FACES = {
    "+z": (0.0, 0.0),
    "-z": (180.0, 0.0),
    "+y": (90.0, 0.0),
    "-y": (90.0, 180.0),
    "+x": (90.0, 90.0),
    "-x": (90.0, -90.0),
}
BEFORE, BETWEEN, AFTER = "before", "exposure", "after"
Celsius = Annotated[float, Field(ge=-100.0, le=200.0)]


class ExposurePart(NominalScale):
    """``cycles`` from ``low_C`` to ``high_C``, each at least for the recipe's ``soak_min_s``.

    Six poses of ``window_s`` are measured ``repeats`` times before and after, at ``temperature_C``, and once at each extreme.
    """

    kind: Literal["exposure"]
    low_C: Celsius
    high_C: Celsius
    cycles: Annotated[int, Field(ge=1, le=100)] = 2
    repeats: Annotated[int, Field(ge=2, le=20)] = 2
    window_s: Annotated[Positive, Field(ge=2.0, le=600.0)] = 10.0
    temperature_C: Celsius = 25.0

    @model_validator(mode="after")
    def _in_order(self) -> "ExposurePart":
        if not self.low_C < self.high_C:
            raise ValueError(f"low_C: {self.low_C:g} °C, below high_C ({self.high_C:g} °C) is needed; exchange them")
        return self


class Exposure(InG, RecordByRecord):
    """Temperature cycles between two measurements in six poses."""

    name = "exposure"
    title = "Exposure to temperature cycles"
    order = 65
    states = "shift of bias and scale by cycles of temperature, at the same temperature and in the same poses before and after"
    source = "RTCA DO-160G section 5, temperature variation; the rate of the air is that of the chamber"
    part = ExposurePart
    figures = (
        FigureSpec(BIAS, "µg", "bias after the exposure minus that before, worst axis"),
        FigureSpec(SCALE, "ppm", "relative change of the scale by the exposure, worst axis"),
    )

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse temperatures and faces outside the limits of the station, and a recipe without a scale."""
        super().check(part, recipe, station)
        limits = station.limits
        wanted = [
            (key, getattr(part, key), "°C", limits.temperature_C, "temperatures within, or another chamber")
            for key in ("low_C", "high_C", "temperature_C")
        ]
        for face, (outer, inner) in FACES.items():
            for axis, angle, allowed in (("outer", outer, limits.outer_deg), ("inner", inner, limits.inner_deg)):
                wanted.append((f"face {face}: {axis} axis", angle, "deg", allowed, "a table that turns so far"))
        for what, value, unit, (low, high), other in wanted:
            if not low <= value <= high:
                raise RecipeInvalid(
                    f"recipe: procedure exposure: {what} {value:g} {unit}, {low:g} to {high:g} {unit} is allowed by the station; "
                    f"take {other}",
                    key=what if hasattr(part, what) else "kind",
                )

    def steps(self, part: ExposurePart, recipe: Recipe) -> list[ProcedureStep]:
        """Six poses several times before, once at every extreme, several times after, always in the same order."""
        ends = [
            (f"{name} {k + 1}", at)
            for k in range(part.cycles)
            for name, at in (("low", part.low_C), ("high", part.high_C))
        ]
        still = part.temperature_C, part.repeats
        series = [(BEFORE, *still), *((name, at, 1) for name, at in ends), (AFTER, *still)]
        return [
            ProcedureStep(
                f"{when} {face}",
                Pose(name=f"{when.replace(' ', '')}{k}", outer_deg=outer, inner_deg=inner),
                at,
                lasting_s=part.window_s,
                soak=soak,
            )
            for soak, (when, at, times) in enumerate(series)
            for k, (face, (outer, inner)) in enumerate(list(FACES.items()) * times)
        ]

    def points(self, part: ExposurePart, taken: Taken, device: Device) -> list[dict[str, Any]]:
        """Mean of a record in µg with its time, temperature and force, and the noise of its samples."""
        letters = taken.own.letters
        output = taken.own.output / scale_of(part, device, taken.unit)[: len(letters)] * MICRO
        angles = (np.radians(float(taken.reading[name])) for name in ("outer_deg", "inner_deg"))
        force = force_from_angles(*angles)
        noise = [noise_columns(short_noise(output[:, i], taken.own.rate_hz)) for i in range(len(letters))]
        series = taken.record.step.name.split()[0]
        return point_rows(
            unit=taken.unit,
            axis=letters,
            series=series if series in {BEFORE, AFTER} else BETWEEN,
            point=taken.number,
            setting=float(taken.own.time.mean()),
            value=[output[:, i].mean() for i in range(len(letters))],
            uncertainty=error_of_mean(output),
            temperature=float(taken.reading["unit_C"]),
            **{f"force_{axis}": float(force[i]) for i, axis in enumerate(AXES)},
            **{name: [each[name] for each in noise] for name in noise[0]},
        )

    def of_unit(self, part: ExposurePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Shifts of the worst axis; a finding where the difference of temperature is not taken out."""
        bias, scale, texts = list[FigureValue](), list[FigureValue](), dict[str, str]()
        for axis, own in rows.groupby("axis", sort=False):
            still, corrected, error, why = _corrected(own)
            if why:
                texts["temperature"] = f"not corrected for, its difference is in both shifts and not in U: {why}"
            time = still["setting"].to_numpy(dtype=float)
            after = (still["series"] == AFTER).to_numpy()
            if not after.any() or after.all():
                raise NotIdentified(
                    f"exposure: no records {BEFORE if after.any() else AFTER} it, both are needed; check the unit and its seat"
                )
            found = exposure_shift(
                _force(still),
                corrected,
                after,
                AXES.index(str(axis)),
                pooled_noise(still),
                float(np.ptp(time[~after])) + part.window_s,
                float(time[after].mean() - time[~after].mean()),
            )
            of_scale = error[1 + AXES.index(str(axis))]
            bias.append(FigureValue(BIAS, str(axis), found.bias.value, float(np.hypot(found.bias.u, error[0]))))
            scale.append(
                FigureValue(SCALE, str(axis), found.scale.value, float(np.hypot(found.scale.u, of_scale)))
            )  # µg/g: ppm
        return [worst(bias), worst(scale)], list(texts.items())

    def chart(self, part: ExposurePart, points: pd.DataFrame) -> Chart:
        """Output of every record about that of its pose before the exposure."""
        traces: list[Trace] = []
        number = np.ones(1)
        for axis in axes_among(points["axis"]):
            still, corrected, *_ = _corrected(points[points["axis"] == axis])
            number = np.arange(1.0, len(still) + 1.0)
            before = (still["series"] == BEFORE).to_numpy()
            if not before.any():
                continue
            own = np.column_stack([np.ones(len(still)), _force(still)])
            fitted = own @ np.linalg.lstsq(own[before], corrected[before], rcond=None)[0]
            error = still["uncertainty"].to_numpy(dtype=float)
            traces.append(Trace(f"axis {axis}", number, corrected - fitted, role=axis, error=error))
        axes = (
            PlotAxis("record; the exposure lies in the middle"),
            PlotAxis("output minus that before the exposure / µg"),
        )
        return Chart(self.title, (Plot("", *axes, (*traces, level(number, 0.0))),))


class _Corrected(NamedTuple):
    """Records before and after of one axis, their values (n,) at one temperature; standard error (4,) that the correction adds.

    ``why`` they are not corrected; empty where they are.
    """

    still: pd.DataFrame
    output: Array
    error: Array
    why: str


def _corrected(rows: pd.DataFrame) -> _Corrected:
    """The change of bias and response with temperature, by the extremes and the records before them, taken out of one axis.

    The records after it are left out of the slope: a shift is no change with temperature.
    """
    still, known = rows[rows["series"] != BETWEEN], rows[rows["series"] != AFTER]
    temperature, output = numbers(still, "temperature", "value")
    at, value = numbers(known, "temperature", "value")
    after = (still["series"] == AFTER).to_numpy()
    try:
        middle = float(temperature.mean()) if temperature.size else float("nan")
        slope = temperature_slope(_force(known), value, at, middle)
    except NotIdentified as problem:
        return _Corrected(still, output, np.zeros(4), str(problem))
    columns = np.column_stack([np.ones(len(still)), _force(still)])
    apart = float(temperature[after].mean() - temperature[~after].mean()) if after.any() and not after.all() else 0.0
    return _Corrected(still, output - columns @ slope.value * (temperature - middle), slope.u * abs(apart), "")


def _force(rows: pd.DataFrame) -> Array:
    return rows[[f"force_{axis}" for axis in AXES]].to_numpy(dtype=float)


PROCEDURE = Exposure()
