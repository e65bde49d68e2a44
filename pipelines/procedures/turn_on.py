"""Repeatability of the bias from turn-on to turn-on, by power cycles."""

from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.dynamics.stability import error_of_mean, repeatability
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, level
from pipelines.procedures.base import InG, NominalScale, RecordByRecord, scale_of
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, worst
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, at_rest, numbers, point_rows
from schemas.bounds import Positive, Wait
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO, axes_among

REPEATABILITY, UPPER = "turn_on_repeatability_ug", "turn_on_upper_limit_ug"
MOST_CYCLES = 20  # of which each has a tick


class TurnOnPart(NominalScale):
    """Cycles of power: off for ``off_s``, on, ``warm_up_s`` of waiting, then the mean of a fixed window of ``window_s``."""

    kind: Literal["turn_on"]
    cycles: Annotated[int, Field(ge=3, le=200)] = 10
    off_s: Annotated[Positive, Field(le=86400.0)] = 600.0
    warm_up_s: Wait = 300.0
    window_s: Annotated[Positive, Field(le=3600.0)] = 30.0


class TurnOn(InG, RecordByRecord):
    """Power cycles in one pose."""

    title = "Turn-on to turn-on repeatability"
    order = 60
    states = "standard deviation of the bias between power cycles, the cycles' own error removed"
    source = "IEEE Std 528, repeatability: same conditions, with periods without power between"
    part = TurnOnPart
    figures = (
        FigureSpec(REPEATABILITY, "µg", "standard deviation of the bias between power cycles, worst axis"),
        FigureSpec(UPPER, "µg", "upper 95 % limit of that standard deviation, by the number of cycles"),
    )

    def steps(self, part: TurnOnPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record per cycle."""
        return [
            ProcedureStep(
                f"cycle {k + 1}",
                at_rest(f"cycle{k + 1}"),
                part.temperature_C,
                lasting_s=part.window_s,
                wait_s=part.warm_up_s,
                off_s=part.off_s,
                setting={"cycle": float(k + 1)},
            )
            for k in range(part.cycles)
        ]

    def points(self, part: TurnOnPart, taken: Taken, device: Device) -> list[dict[str, Any]]:
        """Mean of a cycle in µg; its uncertainty from the scatter of ten parts of the window."""
        letters = taken.samples.letters
        output = taken.samples.output / scale_of(part, device, taken.unit)[: len(letters)] * MICRO
        return point_rows(
            unit=taken.unit,
            axis=letters,
            series="mean",
            point=taken.number,
            setting=taken.number + 1.0,
            value=[output[:, i].mean() for i in range(len(letters))],
            uncertainty=error_of_mean(output),
        )

    def of_unit(self, part: TurnOnPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Scatter of the worst axis, and its upper limit: few cycles cannot pass a limit close to the estimate."""
        value, upper = list[FigureValue](), list[FigureValue]()
        for axis, cycles in rows.groupby("axis", sort=False):
            mean, error = numbers(cycles, "value", "uncertainty")
            within = float(np.sqrt(np.mean(error**2)))
            scatter = repeatability(mean, within)
            spread = float(np.std(mean, ddof=1)) / np.sqrt(2.0 * (scatter.cycles - 1))
            ends = scatter.value, spread, scatter.low, scatter.high
            value.append(FigureValue(REPEATABILITY, str(axis), *ends, dof=scatter.cycles - 1.0, removed=within))
            upper.append(FigureValue(UPPER, str(axis), scatter.upper, 0.0))
        return [worst(value), worst(upper)], []

    def chart(self, part: TurnOnPart, points: pd.DataFrame) -> Chart:
        """Mean of every cycle about the mean of all, with the standard deviation of each axis."""
        traces: list[Trace] = []
        for k, axis in enumerate(axes_among(points["axis"])):
            cycles = points[points["axis"] == axis]
            cycle, value, error = numbers(cycles)
            value = value - value.mean()
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
