"""Warm-up time: from power-on until the output is within its band, and stays there."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field
from scipy.stats import norm

from inertial.dynamics.stability import block_means, settled_error, short_noise
from inertial.dynamics.warm_up import entered
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, between
from pipelines.procedures.base import InG, NominalScale, RecordByRecord, scale_of
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, worst
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, at_rest, numbers, point_rows
from schemas.bounds import Positive
from schemas.recipe import Recipe
from schemas.units import MICRO, axes_among


class WarmUpPart(NominalScale):
    """Power off for ``off_s``, then a record from power-on. ``band_ug`` is the specification about the final value."""

    kind: Literal["warm_up"]
    band_ug: Positive
    off_s: Annotated[Positive, Field(le=86400.0)] = 1800.0
    lasting_s: Annotated[Positive, Field(ge=60.0, le=86400.0)] = 1800.0
    rate_hz: Annotated[Positive, Field(ge=1.0, le=1000.0)] = 10.0
    window_s: Annotated[Positive, Field(le=600.0)] = 10.0


class WarmUp(InG, RecordByRecord):
    """A record from power-on."""

    title = "Warm-up time"
    order = 50
    states = "time from power-on until the smoothed output stays within its band"
    source = "IEEE Std 528, warm-up time; not the time to the first usable output"
    part = WarmUpPart
    figures = (
        FigureSpec("warm_up_s", "s", "time from power-on until the smoothed output stays within its band, worst axis"),
    )

    def steps(self, part: WarmUpPart, recipe: Recipe) -> list[ProcedureStep]:
        """A single record, directly after power-on."""
        pose = at_rest("warm-up")
        lasting, rate = part.lasting_s, part.rate_hz
        return [
            ProcedureStep(
                pose.name, pose, part.temperature_C, lasting_s=lasting, rate_hz=rate, wait_s=0.0, off_s=part.off_s
            )
        ]

    def points(self, part: WarmUpPart, taken: Taken, device: Device) -> Iterator[dict[str, Any]]:
        """Means of 1 s in µg over the time since power-on."""
        size, scale = round(part.rate_hz), scale_of(part, device, taken.unit)
        begun = float(taken.reading["since_power_s"]) - 0.5 * float(taken.reading["duration_s"])
        for i, axis in enumerate(taken.samples.letters):
            second = block_means(taken.samples.output[:, i], size) / scale[i] * MICRO
            noise = float(np.std(np.diff(second), ddof=1) / np.sqrt(2.0)) if second.size > 2 else np.nan
            k = np.arange(second.size)
            time = begun + (k + 0.5) * size / part.rate_hz
            yield from point_rows(
                unit=taken.unit, axis=axis, series="mean_1s", point=k, setting=time, value=second, uncertainty=noise
            )

    def of_unit(self, part: WarmUpPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The time of the slowest axis; not determined where the record ends too soon, or noise alone exceeds the band."""
        return [worst([_figure(part, str(axis), record) for axis, record in rows.groupby("axis", sort=False)])], []

    def chart(self, part: WarmUpPart, points: pd.DataFrame) -> Chart:
        """Output about its final value over the time since power-on, with the band."""
        time = points["setting"].to_numpy(dtype=float)
        traces = [between(time, -part.band_ug, part.band_ug, f"band ± {part.band_ug:g} µg")]
        for axis in axes_among(points["axis"]):
            record = points[points["axis"] == axis]
            since, value = numbers(record, "setting", "value")
            final = value[int(0.8 * value.size) :].mean()
            traces.append(Trace(f"axis {axis}", since, value - final, "line", axis, width=0.8))
        axes = PlotAxis("time since power-on / s"), PlotAxis("output minus final value / µg")
        return Chart(self.title, (Plot("", *axes, tuple(traces)),))


def _figure(part: WarmUpPart, axis: str, rows: pd.DataFrame) -> FigureValue:
    """Warm-up time of one axis; its uncertainty is that of the noise over the slope at the entry, and of the means of 1 s."""
    time, value = numbers(rows, "setting", "value")
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
