"""Bias stability over an hour in one pose, by its several definitions."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.disturbances import disturbance_texts, disturbances
from inertial.dynamics.stability import StabilityFigures, block_means, stability
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.procedures.base import InG, NominalScale, RecordByRecord, scale_of
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, with_uncertainty, worst
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, numbers, point_rows
from schemas.bounds import Positive
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import MICRO, axes_among


class BiasStabilityPart(NominalScale):
    """One record in one pose; ``settle_s`` after the soak is not recorded."""

    kind: Literal["bias_stability"]
    lasting_s: Annotated[Positive, Field(ge=1000.0, le=86400.0)] = 3600.0
    rate_hz: Annotated[Positive, Field(ge=1.0, le=1000.0)] = 10.0
    pose_deg: tuple[float, float] = (0.0, 0.0)


class BiasStability(InG, RecordByRecord):
    """A bias record of an hour."""

    title = "Bias stability"
    order = 40
    states = "standard deviation of 100 s means, drift per hour, Allan deviation at 100 s, and the other definitions"
    source = "IEEE Std 528 for the terms; definitions differ by up to thirty times for one unit, so each is named"
    part = BiasStabilityPart
    figures = (
        FigureSpec("bias_stability_ug", "µg", "standard deviation of 100 s means over the record, worst axis"),
        FigureSpec("bias_drift_ug_h", "µg/h", "slope of the record, worst axis"),
        FigureSpec("bias_allan_100s_ug", "µg", "Allan deviation at 100 s, worst axis; it hides a ramp"),
    )

    def steps(self, part: BiasStabilityPart, recipe: Recipe) -> list[ProcedureStep]:
        """A single record in one pose."""
        pose = Pose(name="stability", outer_deg=part.pose_deg[0], inner_deg=part.pose_deg[1])
        return [ProcedureStep(pose.name, pose, part.temperature_C, lasting_s=part.lasting_s, rate_hz=part.rate_hz)]

    def points(self, part: BiasStabilityPart, taken: Taken, device: Device) -> Iterator[dict[str, Any]]:
        """Means of 1 s in µg from the start of the record."""
        size, scale = round(part.rate_hz), scale_of(part, device, taken.unit)
        for i, axis in enumerate(taken.samples.letters):
            second = block_means(taken.samples.output[:, i], size) / scale[i] * MICRO
            k = np.arange(second.size)
            time = taken.samples.time[0] + k * size / part.rate_hz
            spread = second.std(ddof=1) if second.size > 1 else np.nan
            yield from point_rows(
                unit=taken.unit,
                axis=axis,
                series="mean_1s",
                point=k,
                setting=time - time[:1],
                value=second,
                uncertainty=spread,
            )

    def of_unit(self, part: BiasStabilityPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Figures of the worst axis; every definition as a finding, so that numbers of others can be compared."""
        rate = 1.0 / (round(part.rate_hz) / part.rate_hz)
        by_axis = {
            str(axis): stability(record["value"].to_numpy(dtype=float), rate, device.noise.get((unit, str(axis))))
            for axis, record in rows.groupby("axis", sort=False)
        }
        names = zip(self.figures, ("sd_100s", "drift_h", "allan_100s"), strict=True)
        figures = [
            worst([_figure(spec.name, key, axis, found) for axis, found in by_axis.items()]) for spec, key in names
        ]
        texts = [("definitions of bias stability", _text(axis, found)) for axis, found in by_axis.items()]
        for axis, record in rows.groupby("axis", sort=False):
            if told := disturbance_texts(disturbances(record["value"].to_numpy(dtype=float)), rate, "µg"):
                texts.append(
                    ("disturbed record", f"axis {axis}: {', '.join(told)}; the figures hold it, measure again")
                )
        return figures, texts

    def chart(self, part: BiasStabilityPart, points: pd.DataFrame) -> Chart:
        """Means of 10 s and of 100 s of every axis over time, each about its mean."""
        short: list[Trace] = []
        long: list[Trace] = []
        for axis in axes_among(points["axis"]):
            record = points[points["axis"] == axis]
            seconds, value = numbers(record, "setting", "value")
            time, value = seconds / 60.0, value - value.mean()
            for traces, count, width in ((short, 10, 0.4), (long, 100, 1.8)):
                x, y = block_means(time, count), block_means(value, count)
                traces.append(
                    Trace(f"axis {axis}" if count > 10 else "", x, y, "line", axis, width=width, legend=count > 10)
                )
        axes = PlotAxis("time / min"), PlotAxis("output about its mean / µg")
        return Chart(self.title, (Plot("thick: means of 100 s", *axes, (*short, *long)),))


def _figure(name: str, key: str, axis: str, found: StabilityFigures) -> FigureValue:
    value, error, ends = (getattr(found, f"{key}{end}") for end in ("", "_error", "_interval"))
    return FigureValue(name, axis, value, error, *ends, dof=getattr(found, f"{key}_dof", float("nan")))


def _text(axis: str, found: StabilityFigures) -> str:
    return (
        f"axis {axis}, µg: standard deviation of 1 s means {found.sd_1s:.4g}, of 100 s means {found.sd_100s:.4g}; range of "
        f"1 s means {found.range_1s:.4g}, of 100 s means {found.range_100s:.4g}; Allan deviation at 100 s "
        f"{found.allan_100s:.4g}; drift {with_uncertainty(found.drift_h, 2.0 * found.drift_h_error)} µg/h (k = 2)"
    )


PROCEDURE = BiasStability()
