"""Half-sine shocks against a reference sensor: sensitivity, return, bias shift, shock response spectrum, survival."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.pulses import Pulse, measured_pulse, velocity_change
from inertial.dynamics.shock_diagnosis import DEFAULT
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.wander import stated_error
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace
from pipelines.procedures import shock_waves
from pipelines.procedures.base import (
    REFERENCE,
    Device,
    FigureSpec,
    FigureValue,
    Finding,
    FromWaveforms,
    InG,
    NominalScale,
    OnEquipment,
    Outcome,
    Part,
    ProcedureRecord,
    ProcedureStep,
    UnitRecord,
    refuse_unknown_effects,
    scale_of,
)
from pipelines.procedures.columns import points as point_table
from pipelines.procedures.shock_bias import STUCK, bias_points, bias_shift
from schemas.bounds import NotNegative, Positive, Wait
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import AXES

BEFORE_S = 0.04


class ShockPart(NominalScale):
    """Shocks up and against the axis; the bias is measured on the table before and after, in one pose, over equal windows.

    ``effects`` is the model by which the waveforms of unit and reference are compared; the diagnosis names what is missing.
    ``waveform_percent`` is the standard uncertainty of a sample of that comparison, of the peak.
    """

    kind: Literal["shock"]
    peak_g: Annotated[Positive, Field(le=50000.0)] = 30.0
    duration_ms: Annotated[Positive, Field(ge=0.05, le=60.0)] = 11.0
    shocks: Annotated[int, Field(ge=1, le=20)] = 3
    both_directions: bool = True
    axis: Literal["x", "y", "z"] = "z"
    window_s: Annotated[Positive, Field(ge=5.0, le=3600.0)] = 30.0
    settle_s: Wait = 30.0
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0
    reference_percent: NotNegative = 0.5
    waveform_percent: Annotated[Positive, Field(le=20.0)] = 0.1
    effects: Annotated[list[str], Field(max_length=6)] = Field(default_factory=lambda: list(DEFAULT))

    @model_validator(mode="after")
    def _known(self) -> ShockPart:
        refuse_unknown_effects(self.effects, EFFECTS, "shocks")
        return self


class ShockTest(InG, OnEquipment, FromWaveforms):
    """Half-sine shocks with the bias before and after."""

    name: ClassVar[str] = "shock"
    title: ClassVar[str] = "Half-sine shock"
    order: ClassVar[int] = 120
    states: ClassVar[str] = (
        "sensitivity by comparison, undershoot after the pulse, bias shift, survival; spectrum of reference and unit"
    )
    source: ClassVar[str] = "ISO 16063-22 (comparison), IEC 60068-2-27 (pulse), ISO 18431-4 (shock response spectrum)"
    roles: ClassVar[tuple[str, ...]] = ("shock_machine",)
    part: ClassVar[type[Part]] = ShockPart
    figures: ClassVar[tuple[FigureSpec, ...]] = (
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
    )

    def steps(self, part: ShockPart, recipe: Recipe) -> list[ProcedureStep]:
        """The bias, the shocks, the bias again."""
        still = Pose(name="bias", outer_deg=0.0, inner_deg=0.0)
        machine = Pose(name="shock", outer_deg=0.0, inner_deg=0.0)
        signs = (1.0, -1.0) if part.both_directions else (1.0,)

        def bias(name: str) -> ProcedureStep:
            return ProcedureStep(name, still, part.temperature_C, lasting_s=part.window_s, wait_s=part.settle_s)

        shocks = [
            ProcedureStep(
                f"shock {k + 1}, {'+' if sign > 0 else '−'}{part.axis}",
                machine,
                part.temperature_C,
                lasting_s=5.0,
                role="shock_machine",
                setting={
                    "peak_g": part.peak_g,
                    "duration_s": 1e-3 * part.duration_ms,
                    "direction": sign,
                    "axis": float(AXES.index(part.axis)),
                },
            )
            for sign in signs
            for k in range(part.shocks)
        ]
        return [bias("before"), *shocks, bias("after")]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """One shock."""
        one = step.setting
        return equipment.shock(one["peak_g"], one["duration_s"], int(one["axis"]), int(one["direction"]), slots)

    def setting_of(self, part: ShockPart, reference: UnitRecord) -> dict[str, float]:
        """Peak and direction of a shock, from the reference."""
        axis = AXES.index(part.axis)
        wave = reference.output[:, axis]
        wave = wave - wave[: max(8, int(BEFORE_S * reference.rate_hz))].mean()
        peak = float(wave[int(np.argmax(np.abs(wave)))])
        duration = 1e-3 * part.duration_ms
        return {"peak_g": abs(peak), "duration_s": duration, "direction": float(np.sign(peak)), "axis": float(axis)}

    def reduce(self, part: ShockPart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Peaks of reference and unit, waveforms and spectra of the first shock, and the bias before and after."""
        rows: list[dict[str, Any]] = []
        axis, duration = AXES.index(part.axis), 1e-3 * part.duration_ms
        first = next((k for k, record in enumerate(records) if record.step.role), -1)
        for k, record in enumerate(records):
            for unit, _, own in record.by_unit():
                scale = scale_of(part, device, unit)
                if not record.step.role:
                    rows += bias_points(unit, k, record, own, scale)
                else:
                    pair = shock_waves.filtered_pair(record.samples[REFERENCE], own, axis, scale[axis], duration)
                    entries = _pulse(k, record, own.output[:, axis], pair, device)
                    rows += [one | {"unit": unit, "axis": part.axis} for one in entries]
                    noise = shock_waves.noise_before(pair, BEFORE_S)
                    entries = shock_waves.waves(k, pair, record.step.setting["direction"], settings_of(part), noise)
                    rows += [one | {"unit": unit, "axis": part.axis} for one in entries]
                    if k == first:
                        entries = shock_waves.curves(pair, duration, BEFORE_S)
                        rows += [one | {"unit": unit, "axis": part.axis} for one in entries]
        return point_table(rows)

    def evaluate(self, part: ShockPart, points: pd.DataFrame, device: Device) -> Outcome:
        """Figures of every unit, and whether it has survived."""
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        for unit, rows in points.groupby("unit", sort=False):
            name = str(unit)
            ratio = rows[rows["series"] == "ratio"]
            good = ratio[np.isfinite(ratio["value"])]
            figures[name] = [*_ratio_figures(part, ratio, good), bias_shift(rows)]
            bias = rows[rows["series"] == "bias"]
            if len(bias) and bool((bias.loc[bias["setting"] > 0.0, "uncertainty"] <= STUCK).any()):
                findings.append(
                    Finding(name, "survival", "the output is constant after the shocks: the unit has not survived")
                )
            reference = rows[rows["series"] == "reference"]
            if len(reference):
                peak, lasting = float(reference["value"].abs().mean()), float(reference["duration_s"].mean())
                ideal = velocity_change(peak, lasting)
                text = (
                    f"reference {peak:.4g} g, {1e3 * lasting:.3g} ms, velocity change "
                    f"{float(reference['velocity_m_s'].abs().mean()):.3g} m/s "
                    f"(half sine: {ideal:.3g} m/s; IEC 60068-2-27 allows ± 15 %)"
                )
                findings.append(Finding(name, "pulse", text))
            if len(good):
                findings += [
                    Finding(name, subject, text)
                    for subject, text in shock_waves.diagnosis_text(rows, settings_of(part), part.effects)
                ]
        return Outcome(figures, findings)

    def chart(self, part: ShockPart, points: pd.DataFrame) -> Chart:
        """First shock of reference and unit, and their shock response spectra."""
        shown: dict[str, list[Trace]] = {"wave": [], "spectrum": []}
        for series, factor in (("wave", 1e3), ("spectrum", 1.0)):
            for name, role, width in (("reference", "before", 3.2), ("unit", "after", 1.1)):
                own = points[points["series"] == f"{series}_{name}"]
                x, y = factor * own["setting"].to_numpy(dtype=float), own["value"].to_numpy(dtype=float)
                shown[series].append(Trace(name, x, y, "line", cast("Role", role), width=width))
        left = Plot("", PlotAxis("time / ms"), PlotAxis(f"acceleration on {part.axis} / g"), tuple(shown["wave"]))
        axes = PlotAxis("natural frequency / Hz", log=True), PlotAxis("maximax response, Q = 10 / g")
        return Chart(self.title, (left, Plot("", *axes, tuple(shown["spectrum"]))), 2)


def settings_of(part: ShockPart) -> shock_waves.WaveSettings:
    """What the comparison of the waveforms needs of a part."""
    return shock_waves.WaveSettings(1e-3 * part.duration_ms, BEFORE_S, part.waveform_percent)


def _pulse(
    number: int, record: ProcedureRecord, raw: np.ndarray, pair: shock_waves.Pair, device: Device
) -> list[dict[str, Any]]:
    """Reference pulse and the unit's ratio to it; no value where a pulse is not found or the unit clips.

    Parameters
    ----------
    raw : (n,), output of the unit as recorded; pair : both channels in g behind their low-pass
    """
    (reference, rate), (unit, unit_rate) = pair
    drive = measured_pulse(reference, rate, before_s=BEFORE_S)
    rows = [
        {
            "series": "reference", "point": number, "setting": record.step.setting["direction"], "value": drive.peak,
            "uncertainty": drive.peak_error, "duration_s": drive.duration_s, "velocity_m_s": drive.velocity * 9.80665,
        }
    ]  # fmt: skip
    answer: Pulse | None = None
    limit = device.full_scale
    clipped = bool(
        np.max(np.abs(raw - np.median(raw[: int(BEFORE_S * unit_rate)]))) >= limit or np.max(np.abs(raw)) >= limit
    )
    if not clipped:
        try:
            answer = measured_pulse(unit, unit_rate, before_s=BEFORE_S)
        except NotIdentified:
            answer = None
    ratio = np.nan if answer is None else answer.peak / drive.peak
    error = (
        np.nan
        if answer is None
        else abs(ratio) * float(np.hypot(answer.peak_error / answer.peak, drive.peak_error / drive.peak))
    )
    under = np.nan if answer is None else 100.0 * (answer.undershoot - drive.undershoot)
    row = {
        "series": "ratio", "point": number, "setting": record.step.setting["direction"], "value": ratio, "uncertainty": error,
        "undershoot_percent": under, "clipped": float(clipped), "noise_g": np.nan if answer is None else answer.noise,
    }  # fmt: skip
    return [*rows, row]


def _ratio_figures(part: ShockPart, ratio: pd.DataFrame, good: pd.DataFrame) -> list[FigureValue]:
    names = ("shock_sensitivity_percent", "shock_undershoot_percent")
    if len(good) < len(ratio) or ratio.empty:
        clipped = int((ratio["clipped"] > 0.0).sum()) if len(ratio) else 0
        why = (
            f"{clipped} of {len(ratio)} shocks clip the output"
            if clipped
            else f"{len(ratio) - len(good)} of {len(ratio)} shocks show no pulse"
        )
        note = f"{why}; lower the peak, or choose a wider range" if clipped else f"{why}; check cable and mounting"
        return [FigureValue.not_determined(name, part.axis, note) for name in names]
    value, each = good["value"].to_numpy(dtype=float), good["uncertainty"].to_numpy(dtype=float)
    scatter = float(value.std(ddof=1) / np.sqrt(value.size)) if value.size > 2 else 0.0
    spread = max(scatter, float(np.sqrt(np.mean(each**2)) / np.sqrt(value.size)))
    under = good["undershoot_percent"].to_numpy(dtype=float)
    floor = 100.0 * float(good["noise_g"].mean()) / part.peak_g / np.sqrt(under.size)
    # shocks differ in duration, and so in undershoot: of a few, their scatter is itself uncertain
    scatter = float(under.std(ddof=1) / np.sqrt(under.size)) if under.size > 1 else 0.0
    return [
        FigureValue(
            names[0],
            part.axis,
            float(100.0 * (value.mean() - 1.0)),
            float(np.hypot(100.0 * spread, part.reference_percent)),
        ),
        FigureValue(
            names[1],
            part.axis,
            float(under.mean()),
            stated_error(floor**2 + scatter**2, 1.0, scatter**2 * np.sqrt(2.0 / max(1, under.size - 1))),
        ),
    ]


PROCEDURE = ShockTest()
