"""Repeatability of the bias from turn-on to turn-on, by power cycles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from inertial.dynamics.stability import error_of_mean, repeatability
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
    worst,
)
from pipelines.procedures.columns import points
from schemas.bounds import Positive, Wait
from schemas.poses import Pose
from schemas.units import AXES, MICRO

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.figure import Figure as Drawing

    from schemas.recipe import Recipe


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
        del recipe
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
        del device, part
        figures: dict[str, list[FigureValue]] = {}
        for unit, rows in points.groupby("unit", sort=False):
            value, upper = list[FigureValue](), list[FigureValue]()
            for axis, own in rows.groupby("axis", sort=False):
                mean = own["value"].to_numpy(dtype=float)
                within = float(np.sqrt(np.mean(own["uncertainty"].to_numpy(dtype=float) ** 2)))
                one = repeatability(mean, within)
                spread = float(np.std(mean, ddof=1)) / np.sqrt(2.0 * (one.cycles - 1))
                value.append(FigureValue("turn_on_repeatability_ug", str(axis), one.value, spread, one.low, one.high))
                upper.append(FigureValue("turn_on_upper_limit_ug", str(axis), one.upper, 0.0))
            figures[str(unit)] = [worst(value), worst(upper)]
        return Outcome(figures)

    def draw(self, drawing: Drawing, part: TurnOnPart, points: pd.DataFrame) -> None:
        """Mean of every cycle about the mean of all, with the standard deviation of each axis."""
        del part
        place = drawing.subplots()
        for k, (axis, colour) in enumerate(zip(AXES, ("#0072b2", "#d55e00", "#009e73"), strict=True)):
            own = points[points["axis"] == axis]
            value = own["value"].to_numpy() - own["value"].mean()
            place.errorbar(
                own["setting"] + 0.12 * (k - 1),
                value,
                own["uncertainty"],
                fmt="o",
                ms=3.5,
                lw=0.9,
                c=colour,
                label=f"axis {axis}",
            )
            spread = float(np.std(value, ddof=1))
            for sign in (-1.0, 1.0):
                place.axhline(sign * spread, c=colour, lw=0.7, ls="--")
        place.set(xlabel="power cycle", ylabel="bias about its mean / µg")
        place.margins(y=0.3)  # room for the legend above the points
        place.legend(frameon=False, loc="upper right", ncols=3, title="dashed: standard deviation")


PROCEDURE = TurnOn()
