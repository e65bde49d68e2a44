"""Half-sine shocks against a reference sensor: sensitivity, return, bias shift, shock response spectrum, survival."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
import pandas as pd
from pydantic import Field, model_validator
from scipy.signal import butter, sosfiltfilt

from inertial.dynamics.pulses import Pulse, measured_pulse, velocity_change
from inertial.dynamics.shock_diagnosis import DEFAULT
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.stability import difference_error, white_and_flicker
from inertial.errors import NotIdentified
from pipelines.procedures import shock_waves
from pipelines.procedures.base import (
    REFERENCE,
    Device,
    FigureSpec,
    FigureValue,
    Finding,
    NominalScale,
    Outcome,
    Part,
    Procedure,
    ProcedureRecord,
    ProcedureStep,
    UnitRecord,
    scale_of,
)
from pipelines.procedures.columns import points as point_table
from schemas.bounds import NotNegative, Positive, Wait
from schemas.errors import did_you_mean
from schemas.recipe import Pose
from schemas.units import AXES, MICRO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure as Drawing

    from schemas.recipe import Recipe
    from schemas.station import StationConfig

BEFORE_S = 0.04
CUT = 6.0  # corner of the equal low-pass of both channels, over 1/D
STUCK = 1e-9


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
        for name in self.effects:
            if name not in EFFECTS:
                raise ValueError(f"effects: no effect '{name}' of shocks; {did_you_mean(name, EFFECTS)}")
        return self


class ShockTest(Procedure):
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
    from_waveforms: ClassVar[bool] = True
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
        del recipe
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

    def check(self, part: ShockPart, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a list without a scale."""
        del station
        part.require_scale(recipe)

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
        first = next((k for k, record in enumerate(records) if record.step.role), -1)
        for k, record in enumerate(records):
            for unit in record.readings["unit"]:
                own = record.samples.get(str(unit))
                if own is None:
                    continue
                scale = scale_of(part, device, str(unit))
                if not record.step.role:
                    rows += _bias(str(unit), k, record, own, scale)
                else:
                    found = _pulse(part, k, record, own, scale, device)
                    rows += [one | {"unit": unit, "axis": part.axis} for one in found]
                    pair = _both(part, record, own, scale)
                    noise = _noise(part, record, own, scale)
                    found = shock_waves.waves(k, pair, record.step.setting["direction"], settings_of(part), noise)
                    rows += [one | {"unit": unit, "axis": part.axis} for one in found]
                    if k == first:
                        found = shock_waves.curves(pair, 1e-3 * part.duration_ms, BEFORE_S)
                        rows += [one | {"unit": unit, "axis": part.axis} for one in found]
        return point_table(rows)

    def evaluate(self, part: ShockPart, points: pd.DataFrame, device: Device) -> Outcome:
        """Figures of every unit, and whether it has survived."""
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        del device
        for unit, rows in points.groupby("unit", sort=False):
            name = str(unit)
            ratio = rows[rows["series"] == "ratio"]
            good = ratio[np.isfinite(ratio["value"])]
            figures[name] = [*_ratio_figures(part, ratio, good), _shift(rows)]
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

    def draw(self, drawing: Drawing, part: ShockPart, points: pd.DataFrame) -> None:
        """First shock of reference and unit, and their shock response spectra."""
        left, right = drawing.subplots(1, 2)
        for name, colour, width in (("reference", "#f0a070", 3.2), ("unit", "#0072b2", 1.1)):
            wave = points[points["series"] == f"wave_{name}"]
            left.plot(1e3 * wave["setting"], wave["value"], lw=width, c=colour, label=name)
            spectrum = points[points["series"] == f"spectrum_{name}"]
            right.plot(spectrum["setting"], spectrum["value"], lw=width, c=colour, label=name)
        left.set(xlabel="time / ms", ylabel=f"acceleration on {part.axis} / g")
        right.set(xscale="log", xlabel="natural frequency / Hz", ylabel="maximax response, Q = 10 / g")
        right.xaxis.set_major_formatter("{x:g}")
        right.minorticks_off()
        left.legend(frameon=False)
        right.legend(frameon=False)


def settings_of(part: ShockPart) -> shock_waves.WaveSettings:
    """What the comparison of the waveforms needs of a part."""
    return shock_waves.WaveSettings(1e-3 * part.duration_ms, BEFORE_S, part.waveform_percent)


def _noise(part: ShockPart, record: ProcedureRecord, own: UnitRecord, scale: np.ndarray) -> float:
    """Standard deviation of the difference of both channels before the pulse, behind their low-pass, g."""
    (first, rate), (second, unit_rate) = _both(part, record, own, scale)
    quiet = first[: int(BEFORE_S * rate)], second[: int(BEFORE_S * unit_rate)]
    return float(np.hypot(quiet[0].std(ddof=1), quiet[1].std(ddof=1)))


def _filtered(record: np.ndarray, rate_hz: float, duration_s: float) -> np.ndarray:
    """The record through the equal, phaseless low-pass of both channels."""
    corner = min(CUT / duration_s, 0.4 * rate_hz)
    return np.asarray(sosfiltfilt(butter(2, corner, fs=rate_hz, output="sos"), record))


def _both(
    part: ShockPart, record: ProcedureRecord, own: UnitRecord, scale: np.ndarray
) -> tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]:
    """Filtered reference and unit in g along the axis, with their rates."""
    axis, duration = AXES.index(part.axis), 1e-3 * part.duration_ms
    reference = record.samples[REFERENCE]
    first = _filtered(reference.output[:, axis], reference.rate_hz, duration)
    second = _filtered(own.output[:, axis] / scale[axis], own.rate_hz, duration)
    return (first, reference.rate_hz), (second, own.rate_hz)


def _pulse(
    part: ShockPart, number: int, record: ProcedureRecord, own: UnitRecord, scale: np.ndarray, device: Device
) -> list[dict[str, Any]]:
    """Reference pulse and the unit's ratio to it; no value where a pulse is not found or the unit clips."""
    axis = AXES.index(part.axis)
    (reference, rate), (unit, unit_rate) = _both(part, record, own, scale)
    drive = measured_pulse(reference, rate, before_s=BEFORE_S)
    rows = [
        {
            "series": "reference", "point": number, "setting": record.step.setting["direction"], "value": drive.peak,
            "uncertainty": drive.peak_error, "duration_s": drive.duration_s, "velocity_m_s": drive.velocity * 9.80665,
        }
    ]  # fmt: skip
    answer: Pulse | None = None
    raw = own.output[:, axis]
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


def _bias(unit: str, number: int, record: ProcedureRecord, own: UnitRecord, scale: np.ndarray) -> list[dict[str, Any]]:
    """Mean of every axis in µg, its uncertainty from the scatter of ten parts; ``setting`` is 0 before, 1 after."""
    output = own.output / scale * MICRO
    tenths = np.array([piece.mean(axis=0) for piece in np.array_split(output, 10)])
    error = tenths.std(axis=0, ddof=1) / np.sqrt(10.0)
    noise = [white_and_flicker(output[:, i], own.rate_hz) for i in range(3)]
    after = 0.0 if record.step.name == "before" else 1.0
    return [
        {
            "unit": unit, "axis": axis, "series": "bias", "point": number, "setting": after, "value": float(output[:, i].mean()),
            "uncertainty": float(error[i]), "white": noise[i][0], "flicker": noise[i][1], "window_s": len(output) / own.rate_hz,
            "time_s": float(own.time.mean()),
        }
        for i, axis in enumerate(AXES)
    ]  # fmt: skip


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
        return [FigureValue(name, part.axis, np.nan, np.nan, identified=False, note=note) for name in names]
    value, each = good["value"].to_numpy(dtype=float), good["uncertainty"].to_numpy(dtype=float)
    scatter = float(value.std(ddof=1) / np.sqrt(value.size)) if value.size > 2 else 0.0
    spread = max(scatter, float(np.sqrt(np.mean(each**2)) / np.sqrt(value.size)))
    under = good["undershoot_percent"].to_numpy(dtype=float)
    floor = 100.0 * float(good["noise_g"].mean()) / part.peak_g
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
            float(np.hypot(floor, under.std(ddof=1) / np.sqrt(under.size) if under.size > 1 else 0.0)),
        ),
    ]


def _shift(rows: pd.DataFrame) -> FigureValue:
    """Bias after minus before of the axis with the largest shift; the uncertainty holds white noise and flicker."""
    found: list[FigureValue] = []
    bias = rows[rows["series"] == "bias"]
    pooled = _drifts_apart(bias) if len(bias) else 0.0
    for axis, own in rows[rows["series"] == "bias"].groupby("axis", sort=False):
        before, after = own[own["setting"] == 0.0], own[own["setting"] > 0.0]
        if before.empty or after.empty:
            continue
        value = float(after["value"].iloc[0] - before["value"].iloc[0])
        error = max(pooled, float(np.hypot(after["uncertainty"].iloc[0], before["uncertainty"].iloc[0])))
        stuck = float(after["uncertainty"].iloc[0]) <= STUCK
        note = "the output is constant after the shocks: the unit has not survived" if stuck else ""
        found.append(FigureValue("shock_bias_shift_ug", str(axis), value, error, identified=not stuck, note=note))
    if not found:
        return FigureValue("shock_bias_shift_ug", "*", np.nan, np.nan, identified=False, note="no bias before or after")
    lost = [one for one in found if not one.identified]
    return lost[0] if lost else max(found, key=lambda one: abs(one.value) + 2.0 * one.uncertainty)


def _drifts_apart(bias: pd.DataFrame) -> float:
    """Standard uncertainty of after minus before by white noise and flicker, pooled over the axes."""
    white, flicker, window = (float(bias[name].mean()) for name in ("white", "flicker", "window_s"))
    time = bias["time_s"] if "time_s" in bias else pd.Series([0.0])  # points of earlier versions have none
    return difference_error(white, flicker, window, float(np.ptp(time.to_numpy(dtype=float))))


PROCEDURE = ShockTest()
