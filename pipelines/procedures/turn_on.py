"""Repeatability of the bias from turn-on to turn-on, by power cycles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.dynamics.stability import error_of_mean, repeatability
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, level
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
from schemas.bounds import Positive, Wait
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO

MOST_CYCLES = 20  # of which each has a tick


class TurnOnPart(NominalScale):
    """Cycles of power: off for ``off_s``, on, ``warm_up_s`` of waiting, then the mean of a fixed window of ``window_s``."""

    kind: Literal["turn_on"]
    cycles: Annotated[int, Field(ge=3, le=200)] = 10
    off_s: Annotated[Positive, Field(le=86400.0)] = 600.0
    warm_up_s: Wait = 300.0
    window_s: Annotated[Positive, Field(le=3600.0)] = 30.0
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0


class TurnOn(InG, Evaluated):
    """Power cycles in one pose."""

    name: ClassVar[str] = "turn_on"
    title: ClassVar[str] = "Turn-on to turn-on repeatability"
    order: ClassVar[int] = 60
    states: ClassVar[str] = "standard deviation of the bias between power cycles, the cycles' own error removed"
    source: ClassVar[str] = "IEEE Std 528, repeatability: same conditions, with periods without power between"
    part: ClassVar[type[Part]] = TurnOnPart
    figures: ClassVar[tuple[FigureSpec, ...]] = (
        FigureSpec("turn_on_repeatability_ug", "µg", "standard deviation of the bias between power cycles, worst axis"),
        FigureSpec(
            "turn_on_upper_limit_ug", "µg", "upper 95 % limit of that standard deviation, by the number of cycles"
        ),
    )

    def steps(self, part: TurnOnPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record per cycle."""
        return [
            ProcedureStep(
                f"cycle {k + 1}",
                Pose(name=f"cycle{k + 1}", outer_deg=0.0, inner_deg=0.0),
                part.temperature_C,
                lasting_s=part.window_s,
                wait_s=part.warm_up_s,
                off_s=part.off_s,
                setting={"cycle": float(k + 1)},
            )
            for k in range(part.cycles)
        ]

    def reduce(self, part: TurnOnPart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Mean of every cycle in µg; its uncertainty from the scatter of ten parts of the window."""
        rows: list[dict[str, Any]] = []
        for k, record in enumerate(records):
            for unit, _, own in record.by_unit():
                output = own.output / scale_of(part, device, unit) * MICRO
                error = error_of_mean(output)
                rows += [
                    {
                        "unit": unit, "axis": axis, "series": "mean", "point": k, "setting": float(k + 1),
                        "value": output[:, i].mean(), "uncertainty": error[i],
                    }
                    for i, axis in enumerate(AXES)
                ]  # fmt: skip
        return points(rows)

    def evaluate(self, part: TurnOnPart, points: pd.DataFrame, device: Device) -> Outcome:
        """Scatter of the worst axis, and its upper limit: few cycles cannot pass a limit close to the estimate."""
        figures: dict[str, list[FigureValue]] = {}
        for unit, rows in points.groupby("unit", sort=False):
            value, upper = list[FigureValue](), list[FigureValue]()
            for axis, own in rows.groupby("axis", sort=False):
                mean = own["value"].to_numpy(dtype=float)
                within = float(np.sqrt(np.mean(own["uncertainty"].to_numpy(dtype=float) ** 2)))
                one = repeatability(mean, within)
                spread = float(np.std(mean, ddof=1)) / np.sqrt(2.0 * (one.cycles - 1))
                value.append(
                    FigureValue(
                        "turn_on_repeatability_ug",
                        str(axis),
                        one.value,
                        spread,
                        one.low,
                        one.high,
                        dof=one.cycles - 1.0,
                        removed=within,
                    )
                )
                upper.append(FigureValue("turn_on_upper_limit_ug", str(axis), one.upper, 0.0))
            figures[str(unit)] = [worst(value), worst(upper)]
        return Outcome(figures)

    def chart(self, part: TurnOnPart, points: pd.DataFrame) -> Chart:
        """Mean of every cycle about the mean of all, with the standard deviation of each axis."""
        traces: list[Trace] = []
        for k, axis in enumerate(AXES):
            own = points[points["axis"] == axis]
            cycle, value = own["setting"].to_numpy(dtype=float), own["value"].to_numpy(dtype=float)
            value = value - value.mean()
            error = own["uncertainty"].to_numpy(dtype=float)
            traces.append(Trace(f"axis {axis}", cycle + 0.12 * (k - 1), value, role=axis, error=error))
            spread = float(np.std(value, ddof=1))
            traces += [level(cycle, sign * spread, axis) for sign in (-1.0, 1.0)]
        plot = Plot(
            "dashed: standard deviation",
            PlotAxis("power cycle", step=1.0 if len(points) <= MOST_CYCLES * len(AXES) else None),
            PlotAxis("bias about its mean / µg"),
            (*traces,),
        )
        return Chart(self.title, (plot,))


PROCEDURE = TurnOn()
