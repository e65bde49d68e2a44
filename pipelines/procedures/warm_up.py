"""Warm-up time: from power-on until the output is within its band, and stays there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from pydantic import Field
from scipy.stats import norm

from inertial.dynamics.stability import block_means, settled_error, short_noise
from inertial.dynamics.warm_up import entered
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, between
from pipelines.procedures.base import (
    Device,
    Evaluated,
    FigureSpec,
    FigureValue,
    InG,
    NominalScale,
    Outcome,
    Part,
    ProcedureRecord,
    ProcedureStep,
    scale_of,
)
from pipelines.procedures.columns import points
from pipelines.procedures.worst import worst
from schemas.bounds import Positive
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO


class WarmUpPart(NominalScale):
    """Power off for ``off_s``, then a record from power-on. ``band_ug`` is the specification about the final value."""

    kind: Literal["warm_up"]
    band_ug: Positive
    off_s: Annotated[Positive, Field(le=86400.0)] = 1800.0
    lasting_s: Annotated[Positive, Field(ge=60.0, le=86400.0)] = 1800.0
    rate_hz: Annotated[Positive, Field(ge=1.0, le=1000.0)] = 10.0
    window_s: Annotated[Positive, Field(le=600.0)] = 10.0
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0


class WarmUp(InG, Evaluated):
    """A record from power-on."""

    name: ClassVar[str] = "warm_up"
    title: ClassVar[str] = "Warm-up time"
    order: ClassVar[int] = 50
    states: ClassVar[str] = "time from power-on until the smoothed output stays within its band"
    source: ClassVar[str] = "IEEE Std 528, warm-up time; not the time to the first usable output"
    part: ClassVar[type[Part]] = WarmUpPart
    figures: ClassVar[tuple[FigureSpec, ...]] = (
        FigureSpec("warm_up_s", "s", "time from power-on until the smoothed output stays within its band, worst axis"),
    )

    def steps(self, part: WarmUpPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record directly after power-on."""
        pose = Pose(name="warm-up", outer_deg=0.0, inner_deg=0.0)
        step = ProcedureStep(
            pose.name,
            pose,
            part.temperature_C,
            lasting_s=part.lasting_s,
            rate_hz=part.rate_hz,
            wait_s=0.0,
            off_s=part.off_s,
        )
        return [step]

    def reduce(self, part: WarmUpPart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Means of 1 s in µg over the time since power-on."""
        rows: list[dict[str, Any]] = []
        for record in records:
            for unit, reading, own in record.by_unit():
                scale = scale_of(part, device, unit)
                begun = float(reading["since_power_s"]) - 0.5 * float(reading["duration_s"])
                size = round(part.rate_hz)
                for i, axis in enumerate(AXES):
                    second = block_means(own.output[:, i], size) / scale[i] * MICRO
                    noise = float(np.std(np.diff(second), ddof=1) / np.sqrt(2.0)) if second.size > 2 else np.nan
                    rows += [
                        {
                            "unit": unit, "axis": axis, "series": "mean_1s", "point": k,
                            "setting": begun + (k + 0.5) * size / part.rate_hz, "value": value, "uncertainty": noise,
                        }
                        for k, value in enumerate(second)
                    ]  # fmt: skip
        return points(rows)

    def evaluate(self, part: WarmUpPart, points: pd.DataFrame, device: Device) -> Outcome:
        """The time of the slowest axis; not determined where the record ends too soon, or noise alone exceeds the band."""
        figures: dict[str, list[FigureValue]] = {}
        for unit, rows in points.groupby("unit", sort=False):
            figures[str(unit)] = [
                worst([_figure(part, str(axis), own) for axis, own in rows.groupby("axis", sort=False)])
            ]
        return Outcome(figures)

    def chart(self, part: WarmUpPart, points: pd.DataFrame) -> Chart:
        """Output about its final value over the time since power-on, with the band."""
        time = points["setting"].to_numpy(dtype=float)
        traces = [between(time, -part.band_ug, part.band_ug, f"band ± {part.band_ug:g} µg")]
        for axis in AXES:
            own = points[points["axis"] == axis]
            value = own["value"].to_numpy(dtype=float)
            final = value[int(0.8 * value.size) :].mean()
            traces.append(
                Trace(f"axis {axis}", own["setting"].to_numpy(dtype=float), value - final, "line", axis, width=0.8)
            )
        axes = PlotAxis("time since power-on / s"), PlotAxis("output minus final value / µg")
        return Chart(self.title, (Plot("", *axes, tuple(traces)),))


def _figure(part: WarmUpPart, axis: str, rows: pd.DataFrame) -> FigureValue:
    """Warm-up time of one axis; its uncertainty is that of the noise over the slope at the entry, and of the means of 1 s."""
    time, value = rows["setting"].to_numpy(dtype=float), rows["value"].to_numpy(dtype=float)
    lasting = float(np.ptp(time)) + 1.0
    of_half = short_noise(value[value.size // 2 :], 1.0, trend=1)
    noise = settled_error(of_half.white, of_half.flicker, max(part.window_s, 1.0), 0.2 * lasting, 0.5 * lasting)
    if 3.0 * noise > part.band_ug:
        note = (
            f"noise of the smoothed output against its final value is {noise:.3g} µg, a third of the band of {part.band_ug:g} µg "
            f"at most is needed; lengthen window_s, or widen the band"
        )
        return FigureValue.not_determined("warm_up_s", axis, note)
    try:
        entry = entered(time, value, band=part.band_ug, window_s=part.window_s)
    except NotIdentified as problem:
        return FigureValue.not_determined("warm_up_s", axis, str(problem))
    # of the means of 1 s, in standard uncertainty and at 95 %
    step, reach = 1.0 / np.sqrt(12.0), float(norm.ppf(0.975)) / np.sqrt(12.0)
    low = entry.value - float(np.hypot(entry.value - entry.low, reach))
    high = entry.value + float(np.hypot(entry.high - entry.value, reach))
    return FigureValue("warm_up_s", axis, entry.value, float(np.hypot(step, entry.error)), low, high)


PROCEDURE = WarmUp()
