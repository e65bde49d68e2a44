"""Bias stability over an hour in one pose, by its several definitions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.dynamics.stability import block_means, stability
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.procedures.base import (
    Device,
    Evaluated,
    FigureSpec,
    FigureValue,
    Finding,
    InG,
    NominalScale,
    Outcome,
    Part,
    ProcedureRecord,
    ProcedureStep,
    scale_of,
)
from pipelines.procedures.columns import points
from pipelines.procedures.wording import with_uncertainty
from pipelines.procedures.worst import worst
from schemas.bounds import Positive
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO


class BiasStabilityPart(NominalScale):
    """One record in one pose; ``settle_s`` after the soak is not recorded."""

    kind: Literal["bias_stability"]
    lasting_s: Annotated[Positive, Field(ge=1000.0, le=86400.0)] = 3600.0
    rate_hz: Annotated[Positive, Field(ge=1.0, le=1000.0)] = 10.0
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0
    pose_deg: tuple[float, float] = (0.0, 0.0)


class BiasStability(InG, Evaluated):
    """A bias record of an hour."""

    name: ClassVar[str] = "bias_stability"
    title: ClassVar[str] = "Bias stability"
    order: ClassVar[int] = 40
    states: ClassVar[str] = (
        "standard deviation of 100 s means, drift per hour, Allan deviation at 100 s, and the other definitions"
    )
    source: ClassVar[str] = (
        "IEEE Std 528 for the terms; definitions differ by up to thirty times for one unit, so each is named"
    )
    part: ClassVar[type[Part]] = BiasStabilityPart
    figures: ClassVar[tuple[FigureSpec, ...]] = (
        FigureSpec("bias_stability_ug", "µg", "standard deviation of 100 s means over the record, worst axis"),
        FigureSpec("bias_drift_ug_h", "µg/h", "slope of the record, worst axis"),
        FigureSpec("bias_allan_100s_ug", "µg", "Allan deviation at 100 s, worst axis; it hides a ramp"),
    )

    def steps(self, part: BiasStabilityPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record."""
        pose = Pose(name="stability", outer_deg=part.pose_deg[0], inner_deg=part.pose_deg[1])
        return [ProcedureStep(pose.name, pose, part.temperature_C, lasting_s=part.lasting_s, rate_hz=part.rate_hz)]

    def reduce(self, part: BiasStabilityPart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Means of 1 s in µg from the start of the record; the points keep those of 10 s besides."""
        rows: list[dict[str, Any]] = []
        for record in records:
            for unit, _, own in record.by_unit():
                scale = scale_of(part, device, unit)
                for i, axis in enumerate(AXES):
                    second = block_means(own.output[:, i], round(part.rate_hz)) / scale[i] * MICRO
                    time = own.time[0] + np.arange(second.size) * round(part.rate_hz) / part.rate_hz
                    white = second.std(ddof=1) if second.size > 1 else np.nan
                    rows += [
                        {
                            "unit": unit, "axis": axis, "series": "mean_1s", "point": k, "setting": t - time[0],
                            "value": value, "uncertainty": white,
                        }
                        for k, (t, value) in enumerate(zip(time, second, strict=True))
                    ]  # fmt: skip
        return points(rows)

    def evaluate(self, part: BiasStabilityPart, points: pd.DataFrame, device: Device) -> Outcome:
        """Figures of the worst axis; every definition as a finding, so that numbers of others can be compared."""
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        for unit, rows in points.groupby("unit", sort=False):
            seconds = round(part.rate_hz) / part.rate_hz
            by_axis = {
                str(axis): stability(
                    own["value"].to_numpy(dtype=float), 1.0 / seconds, device.noise.get((str(unit), str(axis)))
                )
                for axis, own in rows.groupby("axis", sort=False)
            }
            figures[str(unit)] = [
                worst(
                    [
                        FigureValue(
                            name,
                            axis,
                            getattr(one, key),
                            getattr(one, f"{key}_error"),
                            *getattr(one, f"{key}_interval"),
                            dof=getattr(one, f"{key}_dof", float("nan")),
                        )
                        for axis, one in by_axis.items()
                    ]
                )
                for name, key in (
                    ("bias_stability_ug", "sd_100s"),
                    ("bias_drift_ug_h", "drift_h"),
                    ("bias_allan_100s_ug", "allan_100s"),
                )
            ]
            for axis, one in by_axis.items():
                text = (
                    f"axis {axis}, µg: standard deviation of 1 s means {one.sd_1s:.4g}, of 100 s "
                    f"means {one.sd_100s:.4g}; range of "
                    f"1 s means {one.range_1s:.4g}, of 100 s means {one.range_100s:.4g}; Allan deviation at 100 s "
                    f"{one.allan_100s:.4g}; drift {with_uncertainty(one.drift_h, 2.0 * one.drift_h_error)} µg/h (k = 2)"
                )
                findings.append(Finding(str(unit), "definitions of bias stability", text))
        return Outcome(figures, findings)

    def chart(self, part: BiasStabilityPart, points: pd.DataFrame) -> Chart:
        """Means of 10 s and of 100 s of every axis over time, each about its mean."""
        short: list[Trace] = []
        long: list[Trace] = []
        for axis in AXES:
            own = points[points["axis"] == axis]
            time, value = own["setting"].to_numpy(dtype=float) / 60.0, own["value"].to_numpy(dtype=float)
            value = value - value.mean()
            for traces, count, width in ((short, 10, 0.4), (long, 100, 1.8)):
                x, y = block_means(time, count), block_means(value, count)
                traces.append(
                    Trace(f"axis {axis}" if count > 10 else "", x, y, "line", axis, width=width, legend=count > 10)
                )
        axes = PlotAxis("time / min"), PlotAxis("output about its mean / µg")
        return Chart(self.title, (Plot("thick: means of 100 s", *axes, (*short, *long)),))


PROCEDURE = BiasStability()
