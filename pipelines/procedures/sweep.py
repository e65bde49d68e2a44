"""Sine comparison: stepped sine on an exciter against a reference sensor; transfer function, its model and its diagnosis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from inertial.dynamics import exciter
from inertial.dynamics.sine_fit import fit_tone, fit_tone_and_frequency, harmonic_distortion
from inertial.dynamics.transfer_diagnosis import Diagnosis, diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points
from inertial.errors import NotIdentified
from pipelines.procedures.base import (
    REFERENCE,
    Device,
    FigureSpec,
    FigureValue,
    Finding,
    Outcome,
    Part,
    Procedure,
    ProcedureRecord,
    ProcedureStep,
    UnitRecord,
)
from pipelines.procedures.columns import points as point_table
from pipelines.procedures.transfer_figures import diagnosis_text, figures_of_transfer, sampling_text
from pipelines.procedures.transfer_plots import draw_bode
from schemas.bounds import NotNegative, Positive
from schemas.errors import RecipeInvalid, did_you_mean
from schemas.recipe import Pose
from schemas.units import AXES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd
    from matplotlib.figure import Figure as Drawing

    from schemas.recipe import Recipe
    from schemas.station import StationConfig

    Array = np.ndarray[Any, np.dtype[np.float64]]

FEWEST_POINTS = 8
MOST_KEPT = 64
SILENT = 8.0  # standard uncertainties that a tone must stand out of the noise


class SweepPart(Part):
    """Frequencies in steps of a fraction of an octave, the level as far as stroke and velocity of the exciter allow.

    Uncertainties are standard ones: ``reference_percent`` is common to all points, ``repeatability_percent`` and
    ``repeatability_deg`` are each point's own. ``transverse_percent`` is the largest transverse sensitivity of the device.
    ``effects`` is the model to be judged; its diagnosis recommends others where it is not good enough.
    """

    kind: Literal["sweep"]
    low_hz: Annotated[Positive, Field(ge=0.5)] = 5.0
    high_hz: Annotated[Positive, Field(le=10000.0)] = 1000.0
    per_octave: Annotated[int, Field(ge=1, le=24)] = 6
    frequencies_hz: Annotated[list[Positive], Field(max_length=400)] = Field(default_factory=list[float])
    level_g: Annotated[Positive, Field(le=50.0)] = 0.5
    other_levels_g: Annotated[list[Positive], Field(max_length=10)] = Field(default_factory=list[float])
    level_frequency_hz: Positive = 160.0
    axis: Literal["x", "y", "z"] = "z"
    cycles: Annotated[int, Field(ge=3, le=1000)] = 20
    record_s: Annotated[Positive, Field(le=60.0)] = 0.25
    temperature_C: Annotated[float, Field(ge=-100.0, le=200.0)] = 25.0
    stroke_mm: Positive = 12.0
    velocity_m_s: Positive = 1.4
    reference_percent: NotNegative = 0.25
    repeatability_percent: NotNegative = 0.1
    repeatability_deg: NotNegative = 0.06
    transverse_percent: NotNegative = 0.3
    flat_to_hz: Positive | None = None
    nominal_scale: Positive | None = None
    bandwidth_order: Annotated[int, Field(ge=1, le=8)] = 2
    effects: Annotated[list[str], Field(min_length=1, max_length=6)] = Field(
        default_factory=lambda: ["second_order", "delay"]
    )

    @model_validator(mode="after")
    def _usable(self) -> SweepPart:
        if self.low_hz >= self.high_hz:
            raise ValueError(f"low_hz: {self.low_hz:g} Hz is not below high_hz, {self.high_hz:g} Hz; correct one")
        for name in self.effects:
            if name not in EFFECTS:
                raise ValueError(f"effects: no effect '{name}'; {did_you_mean(name, EFFECTS)}")
        if len(self.plan()) < FEWEST_POINTS:
            raise ValueError(
                f"per_octave: {len(self.plan())} points, at least {FEWEST_POINTS} are needed; raise "
                f"per_octave, or widen the range"
            )
        return self

    def plan(self) -> list[tuple[float, float]]:
        """Frequency in Hz and level in g of every point, in order of frequency; those at other levels last."""
        count = int(np.floor(self.per_octave * np.log2(self.high_hz / self.low_hz) + 1e-9)) + 1
        grid = self.frequencies_hz or [float(self.low_hz * 2.0 ** (k / self.per_octave)) for k in range(count)]
        reach = exciter.largest_level(
            grid, displacement_m=1e-3 * self.stroke_mm, velocity_m_s=self.velocity_m_s, acceleration_g=self.level_g
        )
        return [*zip(grid, reach.tolist(), strict=True), *((self.level_frequency_hz, g) for g in self.other_levels_g)]

    def lasting(self, frequency: float) -> float:
        """Duration of the record of a point, s: the shortest that is allowed, or the number of cycles."""
        return max(self.record_s, self.cycles / frequency)


class Sweep(Procedure):
    """Stepped sine against a reference sensor."""

    name: ClassVar[str] = "sweep"
    title: ClassVar[str] = "Sine comparison"
    order: ClassVar[int] = 110
    states: ClassVar[str] = (
        "transfer function with uncertainty, natural frequency, damping, −3 dB bandwidth, flatness, missing effects"
    )
    source: ClassVar[str] = "ISO 16063-21 (comparison), ISO 16063-11 method 3 and IEEE Std 1057 (sine fit)"
    roles: ClassVar[tuple[str, ...]] = ("exciter",)
    part: ClassVar[type[Part]] = SweepPart
    rows: ClassVar[int] = 2
    from_waveforms: ClassVar[bool] = True
    figures: ClassVar[tuple[FigureSpec, ...]] = (
        FigureSpec(
            "sweep_bandwidth_hz", "Hz", "frequency at which the magnitude is 3 dB below that at low frequency", True
        ),
        FigureSpec("sweep_natural_hz", "Hz", "undamped natural frequency of the adequate model", True),
        FigureSpec("sweep_damping", "1", "damping ratio of the adequate model", True),
        FigureSpec(
            "sweep_flatness_percent",
            "%",
            "largest departure of the magnitude from that at low frequency, up to flat_to_hz",
        ),
        FigureSpec(
            "sweep_sensitivity_percent",
            "%",
            "departure of the sensitivity from the static scale, or from nominal_scale",
        ),
    )

    def steps(self, part: SweepPart, recipe: Recipe) -> list[ProcedureStep]:
        """One dwell for each point."""
        del recipe
        pose = Pose(name="exciter", outer_deg=0.0, inner_deg=0.0)
        return [
            ProcedureStep(
                f"{frequency:.4g} Hz, {level:.3g} g",
                pose,
                part.temperature_C,
                lasting_s=part.lasting(frequency),
                role="exciter",
                setting={"frequency_hz": frequency, "level_g": level, "axis": float(AXES.index(part.axis))},
            )
            for frequency, level in part.plan()
        ]

    def check(self, part: SweepPart, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a part without a scale to compare the sensitivity with."""
        del station
        if part.nominal_scale is None and not recipe.tumbles:
            raise RecipeInvalid(
                "recipe: procedure sweep has no scale to compare the sensitivity with; set nominal_scale (output per g), or list "
                "multi_position",
                key="nominal_scale",
            )

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The dwell on the exciter."""
        one = step.setting
        seconds = step.lasting_s or 0.0
        return equipment.sine(one["frequency_hz"], one["level_g"], int(one["axis"]), seconds, slots)

    def setting_of(self, part: SweepPart, reference: UnitRecord) -> dict[str, float]:
        """Frequency and level of a dwell, from the largest tone of the reference."""
        axis = AXES.index(part.axis)
        wave = reference.output[:, [axis]] - reference.output[:, axis].mean()
        spectrum = np.abs(np.fft.rfft(wave[:, 0] * np.hanning(len(wave))))
        coarse = float(np.argmax(spectrum[1:]) + 1) * reference.rate_hz / len(wave)
        tone = fit_tone_and_frequency(wave, reference.rate_hz, coarse)
        return {"frequency_hz": tone.frequency, "level_g": float(abs(tone.value[0])), "axis": float(axis)}

    def reduce(self, part: SweepPart, records: Sequence[ProcedureRecord], device: Device) -> pd.DataFrame:
        """Magnitude, phase, and their uncertainty at every point; the device's clock is estimated from all points first."""
        axis = AXES.index(part.axis)
        clocks = _clocks(records, axis)
        rows: list[dict[str, Any]] = []
        for k, record in enumerate(records):
            reference = record.samples[REFERENCE]
            for reading in record.readings.to_dict("records"):
                unit = str(reading["unit"])
                own = record.samples.get(unit)
                if own is not None:
                    rows.append(
                        _point(
                            part, k, record.step.setting, (reference, own), axis, clocks.get(unit, (0.0, 0.0)), device
                        )
                        | {"unit": unit, "temperature_C": float(reading["unit_C"])}
                    )
        return point_table(rows)

    def evaluate(self, part: SweepPart, points: pd.DataFrame, device: Device) -> Outcome:
        """The model, judged; figures of the adequate model, or as not determined with the reason."""
        figures: dict[str, list[FigureValue]] = {}
        findings: list[Finding] = []
        for unit, rows in points.groupby("unit", sort=False):
            name = str(unit)
            kept = rows[np.isfinite(rows["value"])]
            lost = len(rows) - len(kept)
            if lost:
                text = f"{lost} of {len(rows)} points give no tone, or are clipped: they are left out"
                findings.append(Finding(name, "points without a value", text))
            if len(kept) < max(FEWEST_POINTS, 0.8 * len(rows)):
                note = f"{len(kept)} of {len(rows)} points have a value, four fifths are needed; check cable and range"
                figures[name] = [
                    FigureValue(f.name, part.axis, np.nan, np.nan, identified=False, note=note) for f in self.figures
                ]
                continue
            try:
                found = judged(part, kept)
            except NotIdentified as problem:
                note = str(problem)
                figures[name] = [
                    FigureValue(f.name, part.axis, np.nan, np.nan, identified=False, note=note) for f in self.figures
                ]
                continue
            figures[name] = figures_of_transfer(part, found, transfer_points(kept), device.scale.get(name))
            findings += [Finding(name, subject, text) for subject, text in diagnosis_text(found)]
            findings += _conditions(name, kept)
            band = next(one for one in figures[name] if one.figure == "sweep_bandwidth_hz")
            if band.identified:
                text = sampling_text(float(kept["rate_hz"].iloc[0]), band.value, part.bandwidth_order)
                findings.append(Finding(name, "sampling", text))
        return Outcome(figures, findings)

    def draw(self, drawing: Drawing, part: SweepPart, points: pd.DataFrame) -> None:
        """Magnitude with uncertainty, phase, coherence, and the residual of the model."""
        kept = points[np.isfinite(points["value"])]
        if len(kept) >= FEWEST_POINTS:
            draw_bode(drawing, transfer_points(kept), judged(part, kept), kept["coherence"].to_numpy(dtype=float))


_last_judged: dict[str, Diagnosis] = {}
"""Diagnoses of the last sweeps: the report draws what the stage has judged in the same process."""


def judged(part: SweepPart, rows: pd.DataFrame) -> Diagnosis:
    """The diagnosis of the part's model on the points of one unit."""
    points = transfer_points(rows)
    c = points.conditions
    arrays = (c.frequency, c.level, c.temperature, c.record_s, points.value, points.magnitude_error, points.phase_error)
    key = f"{part.model_dump_json()} {hash(b''.join(one.tobytes() for one in arrays))}"
    if key not in _last_judged:
        if len(_last_judged) >= MOST_KEPT:
            _last_judged.clear()
        _last_judged[key] = diagnose_transfer(points, part.effects, highest_hz=max(part.high_hz, 10000.0))
    return _last_judged[key]


def transfer_points(rows: pd.DataFrame) -> Points:
    """Points of one unit as arrays of the science."""

    def column(name: str) -> Array:
        return rows[name].to_numpy(dtype=float)

    conditions = Conditions(column("setting"), column("level_g"), column("temperature_C"), column("record_s"))
    turn = np.exp(1j * np.radians(column("phase_deg")))
    value = np.asarray(column("value") * turn, dtype=np.complex128)
    share = column("uncertainty") / column("value")
    return Points(conditions, value, share, np.radians(column("phase_uncertainty_deg")))


def _clocks(records: Sequence[ProcedureRecord], axis: int) -> dict[str, tuple[float, float]]:
    """Departure of each device's clock from the reference's as a share, and its standard uncertainty, over all points."""
    found: dict[str, list[tuple[float, float]]] = {}
    for record in records:
        frequency = record.step.setting["frequency_hz"]
        for unit, own in record.samples.items():
            if unit == REFERENCE:
                continue
            y = own.output[:, axis : axis + 1]
            if not np.all(np.isfinite(y)) or float(np.ptp(y)) == 0.0:
                continue
            tone = fit_tone_and_frequency(y, own.rate_hz, frequency)
            if abs(tone.value[0]) > SILENT * tone.amplitude_error[0]:
                found.setdefault(unit, []).append((frequency / tone.frequency - 1.0, tone.frequency_error / frequency))
    clocks: dict[str, tuple[float, float]] = {}
    for unit, values in found.items():
        value, error = np.array(values).T
        middle = np.abs(value - np.median(value)) < 5e-3
        weight = error[middle] ** -2.0
        clocks[unit] = (float(np.sum(weight * value[middle]) / np.sum(weight)), float(np.sum(weight) ** -0.5))
    return clocks


def _point(
    part: SweepPart,
    number: int,
    setting: Mapping[str, float],
    records: tuple[UnitRecord, UnitRecord],
    axis: int,
    clock: tuple[float, float],
    device: Device,
) -> dict[str, Any]:
    """One point of one unit: three-parameter fits on both channels, with the device's clock known."""
    reference, own = records
    frequency = setting["frequency_hz"]
    drive = fit_tone(reference.output, reference.rate_hz, frequency)
    tone = fit_tone(own.output[:, axis : axis + 1], own.rate_hz, frequency / (1.0 + clock[0]))
    ratio = tone.value[0] / drive.value[axis]
    size, level = abs(tone.value[0]), float(abs(drive.value[axis]))
    across = float(np.linalg.norm(np.abs(np.delete(drive.value, axis)))) / level
    noise = float(np.hypot(tone.amplitude_error[0] / max(size, 1e-300), drive.amplitude_error[axis] / level))
    transverse = 1e-2 * part.transverse_percent * across / np.sqrt(6.0)
    skew = 2.0 * np.pi * frequency * clock[1] * len(own.output) / own.rate_hz / 2.0
    magnitude = float(np.sqrt(noise**2 + transverse**2 + (1e-2 * part.repeatability_percent) ** 2))
    phase = float(np.sqrt(noise**2 + transverse**2 + np.radians(part.repeatability_deg) ** 2 + skew**2))
    silent = size < SILENT * tone.amplitude_error[0]
    clipped = bool(np.max(np.abs(own.output[:, axis])) >= device.full_scale)
    power = 0.5 * size**2
    whole = not silent and not clipped and bool(np.isfinite(ratio))
    return {
        "axis": part.axis,
        "series": "response",
        "point": number,
        "setting": frequency,
        "value": float(abs(ratio)) if whole else np.nan,
        "uncertainty": float(abs(ratio)) * magnitude if whole else np.nan,
        "phase_deg": float(np.degrees(np.angle(ratio))) if whole else np.nan,
        "phase_uncertainty_deg": float(np.degrees(phase)),
        "level_g": level,
        "record_s": len(own.output) / own.rate_hz,
        "coherence": power / (power + float(tone.sigma[0]) ** 2),
        "distortion_percent": 100.0
        * float(harmonic_distortion(reference.output[:, [axis]], reference.rate_hz, frequency)[0]),
        "transverse_percent": 100.0 * across,
        "clock_ppm": 1e6 * clock[0],
        "clock_uncertainty_ppm": 1e6 * clock[1],
        "rate_hz": own.rate_hz,
    }


def _conditions(unit: str, rows: pd.DataFrame) -> list[Finding]:
    """Own clock, distortion and transverse motion against what is usually held."""
    found: list[Finding] = []
    clock, error = float(rows["clock_ppm"].iloc[0]), float(rows["clock_uncertainty_ppm"].iloc[0])
    if abs(clock) > max(5.0 * error, 5.0):
        text = f"{clock:+.0f} ± {2.0 * error:.1g} ppm (k = 2) against the reference; the sine fits use it"
        found.append(Finding(unit, "clock of the device", text))
    distortion, across = float(rows["distortion_percent"].max()), rows["transverse_percent"]
    limit = np.where(rows["setting"] <= 1000.0, 10.0, 30.0)
    if distortion > 5.0:
        found.append(Finding(unit, "distortion of the exciter", f"{distortion:.1f} %, at most 5 % is usually held"))
    if bool((across > limit).any()):
        at = float(rows["setting"].to_numpy(dtype=float)[int(np.argmax(across.to_numpy(dtype=float)))])
        text = f"{across.max():.0f} % at {at:.4g} Hz, at most 10 % to 1 kHz and 30 % above is usually held"
        found.append(Finding(unit, "transverse motion of the exciter", text))
    return found


PROCEDURE = Sweep()
