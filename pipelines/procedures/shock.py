"""Half-sine shocks against a reference sensor: sensitivity, return, bias shift, shock response spectrum, survival."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.pulses import found_duration
from inertial.dynamics.shock_diagnosis import DEFAULT
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.stability import difference_error, error_of_mean, short_noise
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace
from pipelines.procedures import shock_figures, shock_records
from pipelines.procedures.base import (
    Compares,
    FromWaveforms,
    InG,
    NominalScale,
    OnEquipment,
    refuse_unknown_effects,
    scale_of,
)
from pipelines.procedures.compared import ComparedResult, JudgedCurve, by_share, without
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, worst
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureStep,
    Records,
    Taken,
    UnitRecord,
    at_rest,
    noise_columns,
    numbers,
    on_equipment,
    point_rows,
    point_table,
    pooled_noise,
    taken,
)
from schemas.bounds import NotNegative, Positive, Wait
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO

STUCK = 1e-9  # µg, uncertainty of the mean of an output that never changes
TOO_FAR = 1.5
"""Ratio of the stated to the recorded duration beyond which the low-pass for one would alter the peak of the other."""


class ShockPart(NominalScale):
    """Shocks up and against the axis; the bias is measured on the table before and after, in one pose, over equal windows.

    ``effects`` is the model by which the waveforms of unit and reference are compared; the diagnosis names what is missing.
    ``waveform_percent`` is the standard uncertainty of a sample of that comparison, of the peak. Each record is free of the
    pulse for ``before_ms``. ``transverse_percent`` is the largest transverse sensitivity of the device. In a recording made
    elsewhere both times are found where they are not stated.
    """

    kind: Literal["shock"]
    peak_g: Annotated[Positive, Field(le=50000.0)] = 30.0
    duration_ms: Annotated[Positive, Field(ge=0.05, le=60.0)] = 11.0
    before_ms: Annotated[Positive, Field(le=10000.0)] = 40.0
    shocks: Annotated[int, Field(ge=1, le=20)] = 3
    both_directions: bool = True
    axis: Literal["x", "y", "z"] = "z"
    window_s: Annotated[Positive, Field(ge=5.0, le=3600.0)] = 30.0
    settle_s: Wait = 30.0
    reference_percent: NotNegative = 0.5
    transverse_percent: NotNegative = 0.3
    waveform_percent: Annotated[Positive, Field(le=20.0)] = 0.1
    effects: Annotated[list[str], Field(max_length=6)] = Field(default_factory=lambda: list(DEFAULT))

    @model_validator(mode="after")
    def _known(self) -> Self:
        refuse_unknown_effects(self.effects, EFFECTS, "shocks")
        return self


class ShockTest(InG, OnEquipment, FromWaveforms, Compares):
    """Half-sine shocks with the bias before and after."""

    title = "Half-sine shock"
    order = 120
    states = "sensitivity by comparison, pulse, undershoot, return, zero and bias shift, survival; spectrum of reference and unit"
    source = "ISO 16063-22 (comparison), IEC 60068-2-27 (pulse), ISO 18431-4 (shock response spectrum)"
    roles = ("shock_machine",)
    part = ShockPart
    needs_reference = False
    figures = (
        FigureSpec(
            "shock_sensitivity_percent",
            "%",
            "departure of the peak ratio to the reference from the static or nominal scale",
        ),
        FigureSpec(
            "shock_undershoot_percent",
            "%",
            "largest excursion against the pulse after it, of the peak, beyond that of the reference; mean of the shocks",
        ),
        FigureSpec(
            "shock_bias_shift_ug", "µg", "bias after the shocks minus before, same pose and temperature, worst axis"
        ),
        *shock_figures.OF_PULSE,
    )

    def steps(self, part: ShockPart, recipe: Recipe) -> list[ProcedureStep]:
        """The bias, the shocks, the bias again."""
        before, after = (
            ProcedureStep(name, at_rest("bias"), part.temperature_C, lasting_s=part.window_s, wait_s=part.settle_s)
            for name in ("before", "after")
        )
        shocks = [
            on_equipment(
                "shock_machine",
                f"shock {k + 1}, {'+' if sign > 0 else '−'}{part.axis}",
                part,
                5.0,
                _setting(part, part.peak_g, sign),
                pose="shock",
            )
            for sign in ((1.0, -1.0) if part.both_directions else (1.0,))
            for k in range(part.shocks)
        ]
        return [before, *shocks, after]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording of one shock."""
        setting = step.setting
        return equipment.shock(
            setting["peak_g"], setting["duration_s"], int(setting["axis"]), int(setting["direction"]), slots
        )

    def setting_of(self, part: ShockPart, reference: UnitRecord) -> dict[str, float]:
        """Peak and direction of a shock, from the reference."""
        axis = AXES.index(part.axis)
        wave = reference.output[:, axis]
        wave = wave - np.median(wave)
        peak = float(wave[int(np.argmax(np.abs(wave)))])
        return _setting(part, abs(peak), float(np.sign(peak)))

    def completed(self, part: ShockPart, references: Sequence[UnitRecord]) -> ShockPart:
        """The part with the duration of the pulse and the time before it from the recordings, where the user has stated none."""
        axis = AXES.index(part.axis)
        found = np.array([found_duration(reference.output[:, axis], reference.rate_hz) for reference in references])
        duration, before = 1e3 * float(np.median(found[:, 0])), 1e3 * float(found[:, 1].min())
        stated = part.model_fields_set
        if "duration_ms" in stated and not 1.0 / TOO_FAR < part.duration_ms / duration < TOO_FAR:
            msg = f"duration_ms is {part.duration_ms:g}, the pulse lasts {duration:.3g} ms; correct it, or leave it out"
            raise NotIdentified(msg)
        recorded = {"duration_ms": duration, "before_ms": before}
        return part.model_copy(update={name: value for name, value in recorded.items() if name not in stated})

    def reduce(self, part: ShockPart, records: Records, device: Device) -> pd.DataFrame:
        """Peaks of reference and unit, waveforms and spectra of the first shock, and the bias before and after."""
        rows: list[dict[str, Any]] = []
        axis, duration, before_s = AXES.index(part.axis), 1e-3 * part.duration_ms, 1e-3 * part.before_ms
        first = next((k for k, record in enumerate(records) if record.step.role), -1)
        for measured in taken(records):
            scale = scale_of(part, device, measured.unit)
            if not measured.record.step.role:
                rows += bias_points(measured, scale)
                continue
            direction = measured.record.step.setting["direction"]
            alone = REFERENCE not in measured.record.samples
            in_g = UnitRecord(measured.samples.time, measured.samples.output / scale)
            drive = in_g if alone else measured.record.samples[REFERENCE]
            end_s, earlier, others = shock_records.single_pulse(measured.number, drive, axis, duration)
            answer, drive = (shock_records.until(wave, end_s) for wave in (measured.samples, drive))
            pair = shock_records.filtered_pair(drive, answer, axis, scale[axis], duration)
            lone_s = shock_records.lone_sample([answer] if alone else [answer, drive], axis, duration)
            found = shock_records.Found(alone, lone_s, earlier)
            of_shock = others + shock_records.rows_of(
                measured.number, direction, (answer, drive), axis, pair, (before_s, duration), device, found
            )
            names = ("unit",) if alone else ("reference", "unit")
            if not alone:
                noise = shock_records.noise_before(pair, before_s)
                of_shock += shock_records.waves(measured.number, pair, direction, part, noise)
            if measured.number == first:
                of_shock += shock_records.curves(pair, names, duration, before_s)
            rows += [row | {"unit": measured.unit, "axis": part.axis} for row in of_shock]
        return point_table(rows)

    def of_unit(self, part: ShockPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Figures of a unit, and whether it has survived."""
        texts: list[tuple[str, str]] = []
        ratio, bias, reference = (rows[rows["series"] == name] for name in ("ratio", "bias", "reference"))
        good = ratio[np.isfinite(ratio["value"])]
        if len(bias) and bool((bias.loc[bias["setting"] > 0.0, "uncertainty"] <= STUCK).any()):
            texts.append(("survival", "the output is constant after the shocks: the unit has not survived"))
        pulse = rows[rows["series"] == "pulse"]
        texts += shock_figures.texts_of(reference, pulse, rows[rows["series"] == "other"])
        apart = shock_figures.no_comparison(good, reference, pulse)
        if shock_figures.comparable(rows):
            texts += shock_records.diagnosis_text(rows, part)
        compared = shock_figures.ratio_figures(part, ratio, good, apart)
        return [*compared, bias_shift(bias), *shock_figures.pulse_figures(part.axis, pulse, ratio)], texts

    def compared(
        self, part: ShockPart, rows: pd.DataFrame, figures: Mapping[str, FigureValue], out_unit: str
    ) -> tuple[list[ComparedResult], list[JudgedCurve]]:
        """Sensitivity by comparison, and the figures that it bears out; none without a comparison."""
        results = compared_results(part, figures, int((rows["series"] == "ratio").sum()))
        return results, shock_records.judged_curves(rows, part) if results else []

    def verdict(self, part: ShockPart, rows: pd.DataFrame) -> str:
        """The verdict on the comparison of the waveforms; none without a comparison."""
        return shock_records.verdict(rows, part) if (rows["series"] == "compared").any() else ""

    def chart(self, part: ShockPart, points: pd.DataFrame) -> Chart:
        """First shock of reference and unit, and their shock response spectra."""
        shown: dict[str, list[Trace]] = {"wave": [], "spectrum": []}
        for series, factor in (("wave", 1e3), ("spectrum", 1.0)):
            for name, role, width in (("reference", "before", 3.2), ("unit", "after", 1.1)):
                shock = points[points["series"] == f"{series}_{name}"]
                if shock.empty:  # recorded without a reference
                    continue
                x, y = numbers(shock, "setting", "value")
                shown[series].append(Trace(name, factor * x, y, "line", cast("Role", role), width=width))
        left = Plot("", PlotAxis("time / ms"), PlotAxis(f"acceleration on {part.axis} / g"), tuple(shown["wave"]))
        axes = PlotAxis("natural frequency / Hz", log=True), PlotAxis("maximax response, Q = 10 / g")
        return Chart(self.title, (left, Plot("", *axes, tuple(shown["spectrum"]))), 2)


def _setting(part: ShockPart, peak_g: float, direction: float) -> dict[str, float]:
    axis = float(AXES.index(part.axis))
    return {"peak_g": peak_g, "duration_s": 1e-3 * part.duration_ms, "direction": direction, "axis": axis}


def bias_points(measured: Taken, scale: np.ndarray) -> list[dict[str, Any]]:
    """Mean of every axis in µg, its uncertainty from the scatter of ten parts; ``setting`` is 0 before, 1 after."""
    letters, rate = measured.samples.letters, measured.samples.rate_hz
    output = measured.samples.output / scale[: len(letters)] * MICRO
    noise = [noise_columns(short_noise(output[:, i], rate)) for i in range(len(letters))]
    return point_rows(
        unit=measured.unit,
        axis=letters,
        series="bias",
        point=measured.number,
        setting=0.0 if measured.record.step.name == "before" else 1.0,
        value=[output[:, i].mean() for i in range(len(letters))],
        uncertainty=error_of_mean(output),
        window_s=len(output) / rate,
        time_s=float(measured.samples.time.mean()),
        **{name: [each[name] for each in noise] for name in noise[0]},
    )


def bias_shift(bias: pd.DataFrame) -> FigureValue:
    """Bias after minus before of the axis with the largest shift; the uncertainty holds white noise and flicker."""
    shifts: list[FigureValue] = []
    pooled = 0.0
    if len(bias):  # white noise and flicker of after minus before, pooled over the axes
        time = bias["time_s"].to_numpy(dtype=float) if "time_s" in bias else np.zeros(1)  # earlier versions have none
        pooled = difference_error(pooled_noise(bias), float(bias["window_s"].mean()), float(np.ptp(time)))
    for axis, mean in bias.groupby("axis", sort=False):
        before, after = mean[mean["setting"] == 0.0], mean[mean["setting"] > 0.0]
        if before.empty or after.empty:
            continue
        value = float(after["value"].iloc[0] - before["value"].iloc[0])
        error = max(pooled, float(np.hypot(after["uncertainty"].iloc[0], before["uncertainty"].iloc[0])))
        stuck = float(after["uncertainty"].iloc[0]) <= STUCK
        note = "the output is constant after the shocks: the unit has not survived" if stuck else ""
        shifts.append(FigureValue("shock_bias_shift_ug", str(axis), value, error, identified=not stuck, note=note))
    if not shifts:
        note = "no record at rest before and after the shocks; a recipe with shocks takes both"
        return FigureValue.not_measured("shock_bias_shift_ug", "*", note)
    return worst(shifts)


RELATIVE = ("shock_undershoot_percent", "shock_zero_shift_percent", "shock_duration_ms", "shock_return_ms")
"""Figures that the scale of the unit does not enter."""
UNIT_OF = {spec.name: spec.unit for spec in shock_figures.OF_PULSE} | {"shock_undershoot_percent": "%"}


def compared_results(part: ShockPart, figures: Mapping[str, FigureValue], shocks: int) -> list[ComparedResult]:
    """The results of a comparison, for the budget; none without the sensitivity.

    The bias shift is in µg by the scale that the figures rest on, which the comparison has measured: what it departs by counts.

    Parameters
    ----------
    shocks : of the comparison
    """
    ratio = figures.get("shock_sensitivity_percent")
    if ratio is None:
        return []
    dof = float(shocks - 1) if shocks > 1 else float("inf")
    percent = 100.0 + ratio.value
    terms = by_share(percent, ("reference", "drift", "amplitude", "mounting"))
    terms["transverse"] = 1e-2 * part.transverse_percent / np.sqrt(6.0) * percent
    noise = {"noise": without(ratio.uncertainty, part.reference_percent)}
    results = [ComparedResult("shock_sensitivity", part.axis, "%", ratio.value, noise, terms, dof=dof)]
    for name in RELATIVE:
        figure = figures.get(name)
        if figure is not None:
            quantity = name.rpartition("_")[0]
            results.append(
                ComparedResult(
                    quantity, figure.axis, UNIT_OF[name], figure.value, {"noise": figure.uncertainty}, dof=dof
                )
            )
    shift = figures.get("shock_bias_shift_ug")
    if shift is not None:
        scale = 1e-2 * abs(shift.value) * float(np.hypot(ratio.value, ratio.uncertainty))
        shift_terms = {"noise": shift.uncertainty, "nominal_scale": scale}
        results.append(ComparedResult("shock_bias_shift", shift.axis, "µg", shift.value, shift_terms))
    return results


PROCEDURE = ShockTest()
