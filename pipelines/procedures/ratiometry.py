"""Zero and sensitivity over the supply voltage: ratiometry of outputs that follow it, rejection of those that do not."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.ratiometry import Follows, departures, largest_departure, zero_and_sensitivity
from inertial.dynamics.stability import difference_error, short_noise
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace, level
from pipelines.procedures.base import AtTemperature, RecordByRecord, SetsEquipment
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, with_uncertainty, worst
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, noise_columns, pooled_noise
from schemas.bounds import NotNegative, Positive, Wait
from schemas.errors import RecipeInvalid
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import AXES, MICRO
from stations.profile_files import profile_of

FACES = {"z": ((0.0, 0.0), (180.0, 0.0)), "y": ((90.0, 0.0), (-90.0, 0.0)), "x": ((90.0, 90.0), (-90.0, 90.0))}
"""Angles (outer, inner) of the table with each axis along and against gravity; the order is found from the outputs."""
FARTHEST = 0.5  # of the nominal supply
SENSITIVITY, ZERO, SLOPE = "supply_sensitivity_percent", "supply_zero_percent_fs", "supply_zero_ug_V"


class RatiometryPart(AtTemperature):
    """Both faces of every axis at each supply voltage; the first of ``supplies_V`` is the nominal voltage.

    ``follows`` states whether the output is to follow the supply (ratiometric) or to be independent of it.
    White noise and flicker between the records are estimated from the records; ``repeatability_ug`` is the standard uncertainty
    of a face's mean besides.
    """

    kind: Literal["ratiometry"]
    supplies_V: Annotated[list[Positive], Field(min_length=3, max_length=20)]
    follows: bool = False
    axes: Annotated[list[Literal["x", "y", "z"]], Field(min_length=1, max_length=3)] = Field(
        default_factory=lambda: list(AXES)
    )
    dwell_s: Annotated[Positive, Field(ge=1.0, le=3600.0)] = 10.0
    settle_s: Wait = 10.0
    repeatability_ug: NotNegative = 0.0

    @model_validator(mode="after")
    def _different(self) -> Self:
        if len(set(self.supplies_V)) < len(self.supplies_V):
            raise ValueError("supplies_V: a voltage occurs twice, different ones are needed; remove one")
        for volt in self.supplies_V:
            if not abs(volt / self.supplies_V[0] - 1.0) <= FARTHEST:
                raise ValueError(
                    f"supplies_V: {volt:g} V, at most {100.0 * FARTHEST:g} % from the nominal {self.supplies_V[0]:g} V "
                    "(the first) is allowed; correct it"
                )
        return self


class Ratiometry(SetsEquipment, RecordByRecord):
    """Zero and sensitivity at several supply voltages."""

    title = "Supply voltage"
    order = 70
    states = "zero and sensitivity over the supply voltage: ratiometric error, or rejection of the supply"
    source = "IEEE Std 1293, input-voltage sensitivity; IEEE Std 2700, ratiometricity and power-supply rejection"
    roles = ("power_supply",)
    part = RatiometryPart
    figures = (
        FigureSpec(
            SENSITIVITY,
            "%",
            "largest departure of the sensitivity from that at the nominal supply (times the voltage ratio where the output "
            "follows it), by a straight line over the supply where that is adequate",
        ),
        FigureSpec(ZERO, "%", "the same departure of the zero, of the full scale of the output"),
        FigureSpec(
            SLOPE, "µg/V", "slope of the zero over the supply, after the ratio where the output follows it; worst axis"
        ),
    )

    def steps(self, part: RatiometryPart, recipe: Recipe) -> list[ProcedureStep]:
        """Records on both faces of every axis, at each voltage."""
        return [
            ProcedureStep(
                f"{volt:g} V, {axis} {side}",
                Pose(name=f"{axis}{side}", outer_deg=outer, inner_deg=inner),
                part.temperature_C,
                lasting_s=part.dwell_s,
                wait_s=part.settle_s,
                role="power_supply",
                on_table=True,
                setting={"supply_V": volt, "axis": float(AXES.index(axis)), "side": float(side)},
            )
            for volt in part.supplies_V
            for axis in part.axes
            for side, (outer, inner) in enumerate(FACES[axis])
        ]

    def check(self, part: RatiometryPart, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a voltage that the supply does not have."""
        command = profile_of(station.fitted()["power_supply"]).command("voltage")
        low, high = command.minimum or 0.0, command.maximum or np.inf
        for volt in part.supplies_V:
            if not low <= volt <= high:
                raise RecipeInvalid(
                    f"recipe: procedure ratiometry: supplies_V has {volt:g} V, the supply of station {station.name} has "
                    f"{low:g} to {high:g} V; give voltages inside",
                    key="supplies_V",
                )

    def set_equipment(self, equipment: Any, step: ProcedureStep) -> dict[str, float]:
        """Sets the supply; returns the ratio to its nominal voltage, which the monitor of the slots expects then."""
        return {"supply_ratio": equipment.set_voltage(step.setting["supply_V"])}

    def points(self, part: RatiometryPart, taken: Taken, device: Device) -> Iterator[dict[str, Any]]:
        """Mean of the axis on a face at a voltage, in the unit of the output, with the measured supply."""
        setting, rate = taken.record.step.setting, taken.samples.rate_hz
        axis = int(setting["axis"])
        output = taken.samples.output[:, axis]
        point = {
            "unit": taken.unit, "axis": AXES[axis], "series": "face", "point": taken.number,
            "setting": setting["supply_V"], "value": float(output.mean()),
            "uncertainty": float(output.std(ddof=1) / np.sqrt(output.size)), "side": setting["side"],
            "window_s": output.size / rate, "time_s": float(taken.samples.time.mean()),
            "measured_V": float(taken.reading["supply_V"]), "constant": float(np.ptp(output) == 0.0),
        }  # fmt: skip
        yield point | noise_columns(short_noise(output, rate))

    def of_unit(self, part: RatiometryPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The figures of the worst axis."""
        if bool((rows["constant"] > 0.0).any()):
            raise NotIdentified("the output is constant; check cable and supply")
        by_axis = {axis: over_supply(part, rows[rows["axis"] == axis]) for axis in part.axes}
        figures = [
            worst([_figure(spec.name, axis, follows, device) for axis, follows in by_axis.items()])
            for spec in self.figures
        ]
        return figures, [(f"axis {axis}", _text(part, follows)) for axis, follows in by_axis.items()]

    def chart(self, part: RatiometryPart, points: pd.DataFrame) -> Chart:
        """Departures of sensitivity and zero over the supply voltage."""
        shown: tuple[list[Trace], list[Trace]] = ([], [])
        for k, axis in enumerate(part.axes):
            follows = over_supply(part, points[points["axis"] == axis])
            order = np.argsort(follows.supply)
            aside = 0.015 * (k - 1) * float(np.ptp(follows.supply))  # so that no bar hides another
            at, name, role = follows.supply[order] + aside, f"axis {axis}, U (k = 2)", cast("Role", axis)
            for traces, factor, value, error in (
                (shown[0], 100.0, follows.sensitivity, follows.sensitivity_error),
                (shown[1], 1e3, follows.zero_g, follows.zero_error_g),
            ):
                traces.append(Trace(name, at, factor * value[order], role=role, error=2.0 * factor * error[order]))
                traces.append(Trace("", at, factor * value[order], "line", role, legend=False))
        labels = "departure of the sensitivity / %", "departure of the zero / mg"
        supplies = np.array(part.supplies_V)
        return Chart(
            self.title,
            tuple(
                Plot("", PlotAxis("supply / V"), PlotAxis(label), (level(supplies, 0.0), *traces))
                for label, traces in zip(labels, shown, strict=True)
            ),
            2,
        )


def over_supply(part: RatiometryPart, rows: pd.DataFrame) -> Follows:
    """Departures of one axis of one unit from the nominal supply's zero and sensitivity."""
    supplies = np.array(part.supplies_V)
    means = np.full((len(supplies), 2), np.nan)
    errors, measured = means.copy(), np.full(len(supplies), np.nan)
    for k, volt in enumerate(supplies):
        at_volt = rows[rows["setting"] == volt]
        measured[k] = float(at_volt["measured_V"].mean()) if len(at_volt) else np.nan
        for side in (0, 1):
            face = at_volt[at_volt["side"] == side]
            if len(face):
                means[k, side], errors[k, side] = float(face["value"].iloc[0]), float(face["uncertainty"].iloc[0])
    zero, sensitivity, error = zero_and_sensitivity(means, errors)
    noise, window = pooled_noise(rows), float(rows["window_s"].mean())
    # both faces of a voltage follow each other: slow wander is the same on them, so their mean has it like one longer record,
    # and their difference has what wanders from one face to the other, however long ago the nominal voltage was
    faces, voltages = _times_between(rows)
    zero_error = np.maximum(error, difference_error(noise, 2.0 * window, voltages) / np.sqrt(2.0))
    error = np.maximum(error, 0.5 * difference_error(noise, window, faces))
    at_volt = 1e-6 * part.repeatability_ug * abs(sensitivity[0]) / np.sqrt(2.0)
    error, zero_error = np.hypot(error, at_volt), np.hypot(zero_error, at_volt)
    return departures(measured, zero, sensitivity, error, follows=part.follows, zero_error=zero_error)


def _times_between(rows: pd.DataFrame) -> tuple[float, float]:
    """Mean times between the two faces of a voltage, and between a voltage and the first voltage, s; 0 where none are known."""
    if "time_s" not in rows:  # points of earlier versions have none
        return 0.0, 0.0
    by_voltage = rows.groupby("setting", sort=False)["time_s"]
    middle = by_voltage.mean()
    apart = float((middle - middle.min()).drop(middle.idxmin()).mean()) if len(middle) > 1 else 0.0
    return float(by_voltage.agg(np.ptp).mean()), apart


def _figure(name: str, axis: str, follows: Follows, device: Device) -> FigureValue:
    if not np.all(np.isfinite(follows.sensitivity)):
        note = "a face was not recorded at a voltage; measure again"
        return FigureValue.not_determined(name, axis, note)
    if name == SENSITIVITY:
        value, error, _ = largest_departure(follows.supply, follows.sensitivity, follows.own_error)
        return FigureValue(name, axis, 100.0 * value, 100.0 * error)
    if name == SLOPE:
        return FigureValue(name, axis, MICRO * follows.slope_g_V, MICRO * follows.slope_error_g_V)
    value, error, _ = largest_departure(follows.supply, follows.zero_g, follows.own_zero_error)
    share = 100.0 * follows.scale / device.full_scale
    return FigureValue(name, axis, share * value, share * error)


def _text(part: RatiometryPart, follows: Follows) -> str:
    what = "ratiometric output" if part.follows else "output independent of the supply"
    return (
        f"{what}: sensitivity {100.0 * follows.sensitivity[int(np.argmax(np.abs(follows.sensitivity)))]:+.3g} %, zero "
        f"{with_uncertainty(MICRO * follows.slope_g_V, 2.0 * MICRO * follows.slope_error_g_V)} µg/V (k = 2), from "
        f"{follows.supply.min():.4g} to {follows.supply.max():.4g} V as the reader measures them"
    )


PROCEDURE = Ratiometry()
