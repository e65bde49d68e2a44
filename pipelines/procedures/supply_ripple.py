"""Ripple of the supply at several frequencies: its line in the output of an axis at rest, rejection in dB and µg/V."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.supply_ripple import Line, rejection_db, ripple_line
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.procedures.base import InG, NominalScale, RecordByRecord, SetsEquipment, scale_of
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, at_rest, numbers
from schemas.bounds import Positive, Wait
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import AXES, MICRO
from stations.profile_files import profile_of

HIGHEST_SHARE = 0.4
"""Of the rate of the samples that a ripple may have: the output is filtered above, and the line would be folded."""
RIPPLE_U = 0.01
"""Standard uncertainty of the ripple as a share: the supply is refused where its meter shows 2 % more or less."""
STANDS_OUT = 4.0
REJECTION, SHARE = "ripple_rejection_dB", "ripple_ug_V"


class SupplyRipplePart(NominalScale):
    """A sine of ``ripple_V`` (peak) on the nominal supply at each of ``frequencies_hz``, after a record without it.

    ``scale`` is the nominal scale, output per g, for lists without a multi-position test before the procedure.
    """

    kind: Literal["supply_ripple"]
    ripple_V: Annotated[Positive, Field(le=5.0)] = 0.1
    frequencies_hz: Annotated[list[Positive], Field(min_length=1, max_length=40)] = Field(
        default_factory=lambda: [10.0, 50.0, 100.0, 300.0, 1000.0]
    )
    axis: Literal["x", "y", "z"] = "z"
    rate_hz: Annotated[Positive, Field(le=100000.0)] = 4000.0
    lasting_s: Annotated[Positive, Field(ge=1.0, le=600.0)] = 5.0
    settle_s: Wait = 2.0

    @model_validator(mode="after")
    def _sampled(self) -> Self:
        for hertz in self.frequencies_hz:
            if hertz > HIGHEST_SHARE * self.rate_hz or hertz * self.lasting_s < 5.0:
                low, high = 5.0 / self.lasting_s, HIGHEST_SHARE * self.rate_hz
                raise ValueError(
                    f"frequencies_hz: {hertz:g} Hz, {low:.3g} to {high:g} Hz is needed at {self.rate_hz:g} Hz over "
                    f"{self.lasting_s:g} s; correct it, or the record"
                )
        return self


class SupplyRipple(SetsEquipment, InG, RecordByRecord):
    """A sine on the supply of devices at rest."""

    title = "Supply ripple"
    order = 71
    states = "rejection of ripple on the supply over its frequency"
    source = "IEEE Std 2700, power-supply rejection; IEEE Std 1057 (sine fit)"
    roles = ("power_supply",)
    part = SupplyRipplePart
    figures = (
        FigureSpec(REJECTION, "dB", "ripple of the supply over that of the output, least over the frequencies", True),
        FigureSpec(
            SHARE, "µg/V", "output at the frequency of the ripple over its amplitude, largest over the frequencies"
        ),
    )

    def steps(self, part: SupplyRipplePart, recipe: Recipe) -> list[ProcedureStep]:
        """A record without ripple, and one at each frequency."""
        return [
            ProcedureStep(
                f"{hertz:g} Hz, {volt:g} V" if volt else "no ripple",
                at_rest("ripple"),
                part.temperature_C,
                lasting_s=part.lasting_s,
                rate_hz=part.rate_hz,
                wait_s=part.settle_s,
                role="power_supply",
                on_table=True,
                setting={"ripple_V": volt, "frequency_hz": hertz},
            )
            for volt, hertz in (
                (0.0, part.frequencies_hz[0]),
                *((part.ripple_V, hertz) for hertz in part.frequencies_hz),
            )
        ]

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a supply that makes no ripple, or not at these frequencies, and a rate beyond the station."""
        super().check(part, recipe, station)
        profile = profile_of(station.fitted()["power_supply"])
        if not profile.has("ripple"):
            raise RecipeInvalid(
                f"recipe: procedure supply_ripple: profile {profile.name} of the power supply of station {station.name} has no "
                "'ripple', a supply that adds a sine is needed; take another supply",
                key="kind",
            )
        command = profile.command("ripple_frequency")
        for hertz in part.frequencies_hz:
            if not (command.minimum or 0.0) <= hertz <= (command.maximum or np.inf):
                raise RecipeInvalid(
                    f"recipe: procedure supply_ripple: frequencies_hz has {hertz:g} Hz, the supply of station {station.name} has "
                    f"{command.minimum:g} to {command.maximum:g} Hz; give frequencies inside",
                    key="frequencies_hz",
                )
        if part.rate_hz > station.limits.rate_hz:
            raise RecipeInvalid(
                f"recipe: procedure supply_ripple: rate_hz {part.rate_hz:g} Hz, at most {station.limits.rate_hz:g} Hz is allowed "
                "by the station; lower it",
                key="rate_hz",
            )

    def set_equipment(self, equipment: Any, step: ProcedureStep) -> dict[str, float]:
        """Sets the ripple; the mean of the supply stays."""
        equipment.set_ripple(step.setting["ripple_V"], step.setting["frequency_hz"])
        return {}

    def points(self, part: SupplyRipplePart, taken: Taken, device: Device) -> Iterator[dict[str, Any]]:
        """Amplitude of the line at the frequency in the unit of the output; of the record without ripple at every frequency."""
        setting = taken.record.step.setting
        output = taken.samples.output[:, AXES.index(part.axis)]
        quiet = setting["ripple_V"] == 0.0
        for k, hertz in enumerate(part.frequencies_hz if quiet else [setting["frequency_hz"]]):
            line = ripple_line(output, taken.samples.rate_hz, hertz)
            yield {
                "unit": taken.unit, "axis": part.axis, "series": "quiet" if quiet else "ripple", "point": taken.number + k,
                "setting": hertz, "value": line.amplitude, "uncertainty": line.error, "ripple_V": setting["ripple_V"],
                "scale": float(scale_of(part, device, taken.unit)[AXES.index(part.axis)]),
                "constant": float(np.ptp(output) == 0.0),
            }  # fmt: skip

    def of_unit(self, part: SupplyRipplePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The worst frequency; a finding where a line is there without ripple, too."""
        if bool((rows["constant"] > 0.0).any()):
            raise NotIdentified("the output is constant; check cable and supply")
        ripple = rows[rows["series"] == "ripple"]
        if ripple.empty:
            raise NotIdentified("no record with ripple; check the unit and its seat")
        frequency, amplitude, error, volt, scale = numbers(
            ripple, "setting", "value", "uncertainty", "ripple_V", "scale"
        )
        share = MICRO * amplitude / scale / volt
        k = int(np.argmax(share))
        u = float(np.hypot(MICRO * error[k] / scale[k] / volt[k], RIPPLE_U * share[k]))
        figures = [_rejection(part, ripple, device), FigureValue(SHARE, part.axis, float(share[k]), u)]
        texts = [
            ("over the frequency", f"{share[k]:.3g} µg/V at {frequency[k]:g} Hz, {share.min():.3g} µg/V at the best")
        ]
        quiet = rows[rows["series"] == "quiet"]
        at, there, noise = numbers(quiet)
        hum = there > STANDS_OUT * noise
        if hum.any():
            lines = ", ".join(f"{hertz:g} Hz" for hertz in at[hum])
            texts.append(
                ("without ripple", f"a line is there at {lines} without ripple, too: choose other frequencies")
            )
        return figures, texts

    def chart(self, part: SupplyRipplePart, points: pd.DataFrame) -> Chart:
        """The line in the output over the frequency, with and without ripple."""
        traces: list[Trace] = []
        for series, name in (("ripple", "with ripple, U (k = 2)"), ("quiet", "without")):
            lines = points[points["series"] == series]
            frequency, value, error, scale = numbers(lines, "setting", "value", "uncertainty", "scale")
            traces.append(Trace(name, frequency, MICRO * value / scale, error=2.0 * MICRO * error / scale))
        axes = PlotAxis("frequency of the ripple / Hz", log=True), PlotAxis("line in the output / µg")
        return Chart(self.title, (Plot("", *axes, tuple(traces)),))


def _rejection(part: SupplyRipplePart, ripple: pd.DataFrame, device: Device) -> FigureValue:
    """The least rejection; none of an output that is no voltage."""
    if device.out_unit != "V":
        note = f"the output is in {device.out_unit}, a voltage is needed for a ratio in dB; {SHARE} states it"
        return FigureValue.not_determined(REJECTION, part.axis, note)
    found = [
        rejection_db(Line(volt, RIPPLE_U * volt), Line(value, error))
        for value, error, volt in zip(*numbers(ripple, "value", "uncertainty", "ripple_V"), strict=True)
    ]
    value, u = min(found)
    return FigureValue(REJECTION, part.axis, value, u)


PROCEDURE = SupplyRipple()
