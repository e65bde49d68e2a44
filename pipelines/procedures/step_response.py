"""Step response by the self-test inputs: settling time into a band, overshoot, rise time."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from inertial.arrays import Array
from inertial.dynamics.pulse_faults import CLOSE, flat_top, lone_samples
from inertial.dynamics.pulses import span
from inertial.dynamics.step_record import RISE_POINTS, StepFigures, aligned, step_figures
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, between
from pipelines.procedures.base import AtTemperature, FromWaveforms, OnEquipment
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, worst
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureStep,
    Records,
    UnitRecord,
    numbers,
    on_equipment,
    point_rows,
    point_table,
)
from schemas.bounds import Positive
from schemas.recipe import Recipe
from schemas.units import axes_among

SETTLING, OVERSHOOT, RISE = "step_settling_ms", "step_overshoot_percent", "step_rise_ms"
BEFORE_SHARE = 0.25  # of the step's duration, recorded before the edge
FINAL_SHARE = 0.3  # of the step's duration, at its end: the final value
BINS = 2  # points of the averaged response for each sample interval
MOST_EDGES = 16  # of the drive in a record: noise alone crosses its middle at every other sample
WIDTHS = (3.0, 1.9, 0.8)  # axes that agree still show one above the other


class StepPart(AtTemperature):
    """Steps of voltage on the self-test inputs of the devices, averaged about the edge of the drive.

    ``band_percent`` is the band of the settling time, of the step; ``hold_ms`` is the duration of a step.
    """

    kind: Literal["step_response"]
    volts: Annotated[Positive, Field(le=20.0)] = 2.0
    steps: Annotated[int, Field(ge=4, le=1000)] = 16
    hold_ms: Annotated[Positive, Field(ge=1.0, le=1000.0)] = 12.0
    band_percent: Annotated[Positive, Field(ge=0.05, le=20.0)] = 2.0


class StepResponse(OnEquipment, FromWaveforms):
    """Steps of force by the self-test of the devices."""

    title = "Step response"
    order = 116
    states = "settling time into a band, overshoot, rise time, of the worst axis"
    source = "IEEE Std 1293, response to a step; electrostatic or magnetic self-test as the source of the step"
    roles = ("step_generator",)
    part = StepPart
    reference_unit = "V"
    figures = (
        FigureSpec(
            SETTLING, "ms", "time from the edge of the drive until the response stays within band_percent of the step"
        ),
        FigureSpec(OVERSHOOT, "%", "largest value of the response above the final value, of the step"),
        FigureSpec(RISE, "ms", "time from 10 % to 90 % of the step"),
    )

    def steps(self, part: StepPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record for each step."""
        setting = _setting(part, part.volts)
        names = [f"step {k + 1}" for k in range(part.steps)]
        lasting = 2.0 * setting["hold_s"]
        return [on_equipment("step_generator", name, part, lasting, setting, pose="step") for name in names]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording of one step of voltage."""
        setting = step.setting
        return equipment.step(setting["volts"], setting["hold_s"], setting["before_s"], slots)

    def setting_of(self, part: StepPart, reference: UnitRecord) -> dict[str, float]:
        """Voltage of the step, from the recorded drive."""
        return _setting(part, float(np.ptp(reference.output[:, 0])))

    def reduce(self, part: StepPart, records: Records, device: Device) -> pd.DataFrame:
        """The averaged response of every axis as a share of the step, over the time from the edge of the drive."""
        rows: list[dict[str, Any]] = []
        edges = [_edge(record.samples[REFERENCE]) for record in records]
        for unit in dict.fromkeys(str(name) for record in records for name in record.readings["unit"]):
            recorded = [
                (record.samples[unit], edge)
                for record, edge in zip(records, edges, strict=True)
                if unit in record.samples
            ]
            for i, axis in enumerate(recorded[0][0].letters if recorded else ()):
                rows += [point | {"unit": unit, "axis": axis} for point in _averaged(part, recorded, i, device)]
        return point_table(rows)

    def of_unit(self, part: StepPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The figures of the worst axis."""
        values: list[list[FigureValue]] = []
        texts: list[tuple[str, str]] = []
        for axis, response in rows.groupby("axis", sort=False):
            try:
                step = axis_figures(part, response)
            except NotIdentified as problem:
                values.append(self.nothing(part, f"axis {axis}: {problem}", str(axis)))
                continue
            values.append(_values(part, str(axis), step))
            texts.append(
                (f"delay of axis {axis}", f"{1e3 * step.delay_s:.4g} ms from the edge of the drive to 50 % of the step")
            )
        return [worst(of_figure) for of_figure in zip(*values, strict=True)], texts

    def chart(self, part: StepPart, points: pd.DataFrame) -> Chart:
        """The response of every axis, and its last part about the final value with the band and the settling times."""
        full: list[Trace] = []
        last: list[Trace] = []
        settled = float("nan")
        most = 5.0 * part.band_percent
        for axis, width in zip(axes_among(points["axis"]), WIDTHS, strict=False):
            response = points[points["axis"] == axis].sort_values("setting")
            time, value = (
                1e3 * response["setting"].to_numpy(dtype=float),
                100.0 * response["value"].to_numpy(dtype=float),
            )
            full.append(Trace(f"axis {axis}", time, value, "line", axis, width=width))
            last.append(Trace(f"axis {axis}", time, value - 100.0, "line", axis, width=width))
            try:
                settled = 1e3 * axis_figures(part, response).settling_s
            except NotIdentified:
                continue
            last.append(
                Trace("", np.full(2, settled), np.array([-most, most]), "line", axis, dashed=True, legend=False)
            )
        end = max(float(trace.x.max()) for trace in full)
        edges = ((-1.0 * settled, 5.0 * settled), (0.0, 4.0 * settled)) if np.isfinite(settled) else ((None, None),) * 2
        label = "time from the edge of the drive / ms"
        band = between(np.array([0.0, end]), -part.band_percent, part.band_percent, f"band ± {part.band_percent:g} %")
        left = Plot(
            "", PlotAxis(label, low=edges[0][0], high=edges[0][1]), PlotAxis("response / % of the step"), (*full,)
        )
        right = Plot(
            "dashed: settling time",
            PlotAxis(label, low=edges[1][0], high=edges[1][1]),
            PlotAxis("response minus final value / %", low=-most, high=most),
            (band, *last),
        )
        return Chart(self.title, (left, right), 2)


def _setting(part: StepPart, volts: float) -> dict[str, float]:
    hold = 1e-3 * part.hold_ms
    return {"volts": volts, "hold_s": hold, "before_s": BEFORE_SHARE * hold}


def axis_figures(part: StepPart, rows: pd.DataFrame) -> StepFigures:
    """Figures of one axis from its averaged response."""
    if bool((rows["fault"] > 0.0).any()):
        raise NotIdentified(FAULTS[int(rows["fault"].iloc[0])])
    response = rows.sort_values("setting")
    time, value, error = numbers(response)
    rate = float(response["rate_hz"].iloc[0])
    figures = step_figures(
        time,
        value,
        error,
        band=1e-2 * part.band_percent,
        edge_error_s=float(response["edge_error_s"].iloc[0]),
        bin_s=1.0 / rate / BINS,
    )
    samples = figures.rise_s * rate
    if samples < RISE_POINTS:
        msg = (
            f"{samples:.1f} samples in the rise time, {RISE_POINTS:g} are needed to resolve a tenth of 1/f_n; record the "
            "analogue output, or use a sweep"
        )
        raise NotIdentified(msg)
    return figures


FAULTS: Mapping[int, str] = {
    1: "no step in the output; check the self-test input, the cable and the drive",
    2: "the output is clipped; lower volts",
    3: "a sample departs alone; check the data line, step again",
}


def _edge(reference: UnitRecord) -> float:
    """Time of the first edge of the drive, rising or falling, s from the beginning of the record."""
    drive = reference.output[:, 0]
    half = 0.5 * (drive.min() + drive.max())
    crossings = np.flatnonzero(np.diff(drive > half)) + 1
    if not 0 < crossings.size <= MOST_EDGES:
        msg = (
            f"step: the recorded drive crosses its middle {crossings.size} times, one edge is needed; check the trigger"
        )
        raise NotIdentified(msg)
    above = int(crossings[0])
    share = (half - drive[above - 1]) / (drive[above] - drive[above - 1])
    return float((above - 1 + share) / reference.rate_hz)


def _averaged(
    part: StepPart, recorded: Sequence[tuple[UnitRecord, float]], axis: int, device: Device
) -> list[dict[str, Any]]:
    """The response of an axis as a share of its step, averaged over the steps in bins of time."""
    hold, rate = 1e-3 * part.hold_ms, recorded[0][0].rate_hz
    times = [np.arange(len(channel.output)) / rate - edge for channel, edge in recorded]
    outputs = [channel.output[:, axis] for channel, _ in recorded]
    before = [output[time < -2.0 / rate] for time, output in zip(times, outputs, strict=True)]
    final = [
        output[(time > (1.0 - FINAL_SHARE) * hold) & (time < hold - 2.0 / rate)]
        for time, output in zip(times, outputs, strict=True)
    ]
    base, size = np.array([output.mean() for output in before]), np.array([output.mean() for output in final])
    step = float(np.mean(size - base))
    noise = float(np.sqrt(np.mean([output.var(ddof=1) for output in before])))
    fault = 0
    beyond = [np.sign(step) * (output - end) for output, end in zip(outputs, size, strict=True)]
    at_end = max(float(np.max(np.abs(output))) for output in outputs) >= device.full_scale
    if at_end or any(_cut_off(excess, rate, noise) for excess in beyond):
        fault = 2
    elif not abs(step) > 10.0 * noise / np.sqrt(len(final[0])) or noise == 0.0:
        fault, step = 1, step or 1.0
    elif any(lone_samples(output, rate, hold, 0.01 * part.band_percent).size for output in outputs):
        fault = 3
    shares = [(output - first) / step for output, first in zip(outputs, base, strict=True)]
    time = np.concatenate(times if fault else aligned(times, shares))
    share = np.concatenate(shares)
    inside = (time >= -0.5 * BEFORE_SHARE * hold) & (time < hold - 2.0 / rate)
    time, share = time[inside], share[inside]
    bins = np.floor(time * rate * BINS).astype(int)
    bins -= bins.min()
    count = np.bincount(bins)
    there = count > 0
    middle, value = (np.bincount(bins, weights=weights)[there] / count[there] for weights in (time, share))
    return point_rows(
        series="response",
        point=np.arange(middle.size),
        setting=middle,
        value=value,
        uncertainty=np.maximum(noise / abs(step) / np.sqrt(count[there]), 1e-12),
        edge_error_s=1.0 / rate / np.sqrt(12.0 * len(recorded)),
        rate_hz=rate,
        fault=float(fault),
        step=step,
    )


def _cut_off(beyond: Array, rate: float, noise: float) -> bool:
    """Whether the first overshoot of a response (n,) beyond its final value is cut off flat."""
    first = int(np.argmax(beyond > 0.0)) if beyond.size and beyond[0] < 0.0 else beyond.size
    top = first + int(np.argmax(beyond[first:])) if first < beyond.size else first
    if top >= beyond.size or not beyond[top] > 0.0:
        return False
    low, high = span(beyond, top, 0.0)
    lobe = np.pad(beyond[low : high + 1], CLOSE)
    return flat_top(lobe, rate, (high - low + 1) / rate, noise, 0.0) > 0


def _values(part: StepPart, axis: str, found: StepFigures) -> list[FigureValue]:
    value, spread, low, high = (
        1e3 * s for s in (found.settling_s, found.settling_error_s, found.settling_low_s, found.settling_high_s)
    )
    if found.settling_identified:
        settling = FigureValue(SETTLING, axis, value, spread, value - 1.96 * spread, value + 1.96 * spread)
    else:
        note = (
            f"an extremum of the response lies at the edge of the band of ± {part.band_percent:g} %: the settling time is "
            f"{low:.3g} or {high:.3g} ms; average more steps, or choose another band_percent"
        )
        settling = FigureValue(SETTLING, axis, value, spread, low, high, identified=False, note=note)
    return [
        settling,
        FigureValue(OVERSHOOT, axis, 100.0 * found.overshoot, 100.0 * found.overshoot_error),
        FigureValue(RISE, axis, 1e3 * found.rise_s, 1e3 * found.rise_error_s),
    ]


PROCEDURE = StepResponse()
