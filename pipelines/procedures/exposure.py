"""Shift of bias and scale by cycles of temperature: six poses, the cycles, the same poses again."""

from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.exposure import exposure_shift
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
    at_rest,
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

    Six poses are measured ``repeats`` times before and after, each for ``window_s``, at ``temperature_C``.
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
        """Refuse temperatures outside the limits of the station, and a recipe without a scale."""
        super().check(part, recipe, station)
        low, high = station.limits.temperature_C
        for key in ("low_C", "high_C"):
            value = getattr(part, key)
            if not low <= value <= high:
                raise RecipeInvalid(
                    f"recipe: procedure exposure: {key} {value:g} °C, {low:g} to {high:g} °C is allowed by the station; take "
                    "temperatures within, or another chamber",
                    key=key,
                )

    def steps(self, part: ExposurePart, recipe: Recipe) -> list[ProcedureStep]:
        """Six poses to and fro before, a record at every extreme, six poses to and fro after."""
        ends = [
            (f"{name} {k + 1}", at)
            for k in range(part.cycles)
            for name, at in (("low", part.low_C), ("high", part.high_C))
        ]
        last = len(ends) + 1
        between = [
            ProcedureStep(name, at_rest(name.replace(" ", "")), at, lasting_s=part.window_s, soak=k)
            for k, (name, at) in enumerate(ends, start=1)
        ]
        return [*self._six(part, BEFORE, 0), *between, *self._six(part, AFTER, last)]

    @staticmethod
    def _six(part: ExposurePart, when: str, soak: int) -> list[ProcedureStep]:
        faces = list(FACES.items())
        order = [one for k in range(part.repeats) for one in (faces if k % 2 == 0 else faces[::-1])]
        return [
            ProcedureStep(
                f"{when} {name}",
                Pose(name=f"{when}{k}", outer_deg=outer, inner_deg=inner),
                part.temperature_C,
                lasting_s=part.window_s,
                soak=soak,
            )
            for k, (name, (outer, inner)) in enumerate(order)
        ]

    def points(self, part: ExposurePart, one: Taken, device: Device) -> list[dict[str, Any]]:
        """Mean of a record in µg with its time, temperature and force, and the noise of its samples."""
        letters = one.own.letters
        output = one.own.output / scale_of(part, device, one.unit)[: len(letters)] * MICRO
        angles = (np.radians(float(one.reading[name])) for name in ("outer_deg", "inner_deg"))
        force = force_from_angles(*angles)
        noise = [noise_columns(short_noise(output[:, i], one.own.rate_hz)) for i in range(len(letters))]
        series = one.record.step.name.split()[0]
        return point_rows(
            unit=one.unit,
            axis=letters,
            series=series if series in {BEFORE, AFTER} else BETWEEN,
            point=one.number,
            setting=float(one.own.time.mean()),
            value=[output[:, i].mean() for i in range(len(letters))],
            uncertainty=error_of_mean(output),
            temperature=float(one.reading["unit_C"]),
            **{f"force_{axis}": float(force[i]) for i, axis in enumerate(AXES)},
            **{name: [each[name] for each in noise] for name in noise[0]},
        )

    def of_unit(self, part: ExposurePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Shifts of the worst axis."""
        bias, scale = list[FigureValue](), list[FigureValue]()
        for axis, own in rows.groupby("axis", sort=False):
            still, corrected = _corrected(own)
            time = still["setting"].to_numpy(dtype=float)
            after = (still["series"] == AFTER).to_numpy()
            if not after.any() or after.all():
                raise NotIdentified(
                    f"exposure: no records {BEFORE if after.any() else AFTER} it, both are needed; check the unit and its seat"
                )
            found = exposure_shift(
                still[[f"force_{one}" for one in AXES]].to_numpy(dtype=float),
                corrected,
                after,
                AXES.index(str(axis)),
                pooled_noise(still),
                float(np.ptp(time[~after])) + part.window_s,
                float(time[after].mean() - time[~after].mean()),
            )
            bias.append(FigureValue(BIAS, str(axis), found.bias.value, found.bias.u))
            scale.append(FigureValue(SCALE, str(axis), found.scale.value, found.scale.u))  # µg per g of the scale: ppm
        return [worst(bias), worst(scale)], []

    def chart(self, part: ExposurePart, points: pd.DataFrame) -> Chart:
        """Output of every record about that of its pose before the exposure."""
        traces: list[Trace] = []
        number = np.ones(1)
        for axis in axes_among(points["axis"]):
            still, corrected = _corrected(points[points["axis"] == axis])
            number = np.arange(1.0, len(still) + 1.0)
            before = (still["series"] == BEFORE).to_numpy()
            if not before.any():
                continue
            own = np.column_stack([np.ones(len(still)), still[[f"force_{one}" for one in AXES]].to_numpy(dtype=float)])
            fitted = own @ np.linalg.lstsq(own[before], corrected[before], rcond=None)[0]
            error = still["uncertainty"].to_numpy(dtype=float)
            traces.append(Trace(f"axis {axis}", number, corrected - fitted, role=axis, error=error))
        axes = (
            PlotAxis("record; the exposure lies in the middle"),
            PlotAxis("output minus that before the exposure / µg"),
        )
        return Chart(self.title, (Plot("", *axes, (*traces, level(number, 0.0))),))


def _corrected(rows: pd.DataFrame) -> tuple[pd.DataFrame, np.ndarray]:
    """The records before and after of one axis, and their values (n,) at one temperature, by the change between the extremes."""
    still, ends = rows[rows["series"] != BETWEEN], rows[rows["series"] == BETWEEN]
    at, value = numbers(ends, "temperature", "value")
    slope = float(np.polyfit(at, value, 1)[0]) if at.size > 1 and np.ptp(at) > 1.0 else 0.0
    (temperature, output) = numbers(still, "temperature", "value")
    return still, output - slope * (temperature - temperature.mean())


PROCEDURE = Exposure()
