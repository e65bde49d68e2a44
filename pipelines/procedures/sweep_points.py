"""Part and reduction of a sweep: its plan, the transfer function at every point, clocks, and conditions of the exciter."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics import spectra
from inertial.dynamics.frequency_response import frequency_response
from inertial.dynamics.sine_fit import HARMONICS, fit_tone, fit_tone_and_frequency, harmonic_distortion
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points
from pipelines.procedures.base import AtTemperature, Celsius, refuse_unknown_effects
from pipelines.procedures.recorded import REFERENCE, Array, Device, ProcedureRecord, UnitRecord, point_rows
from schemas.bounds import NotNegative, Positive
from schemas.exposure_profile import Pressure

FEWEST_POINTS = 8
POINTS_OF_RECORD = 10_000  # numbers of points that belong to one record of many


class SweepPart(AtTemperature):
    """Frequencies in steps of a fraction of an octave, the level as far as stroke and velocity of the exciter allow.

    Uncertainties are standard ones: ``reference_percent`` is common to all points, ``repeatability_percent`` and
    ``repeatability_deg`` are each point's own. ``transverse_percent`` is the largest transverse sensitivity of the device.
    ``effects`` is the model to be judged; its diagnosis recommends others where it is not good enough. All points are measured
    again at ``other_temperatures_C``, and at ``pressures_hPa`` by a climate unit about the exciter.
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
    other_temperatures_C: Annotated[list[Celsius], Field(max_length=20)] = Field(default_factory=list[float])
    pressures_hPa: Annotated[list[Pressure], Field(max_length=20)] = Field(default_factory=list[float])
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
    def _usable(self) -> Self:
        if self.low_hz >= self.high_hz:
            raise ValueError(f"low_hz: {self.low_hz:g} Hz is not below high_hz, {self.high_hz:g} Hz; correct one")
        refuse_unknown_effects(self.effects, EFFECTS, "sweeps")
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
        reach = spectra.largest_level(
            grid, displacement_m=1e-3 * self.stroke_mm, velocity_m_s=self.velocity_m_s, acceleration_g=self.level_g
        )
        return [*zip(grid, reach.tolist(), strict=True), *((self.level_frequency_hz, g) for g in self.other_levels_g)]

    def lasting(self, frequency: float) -> float:
        """Duration of the record of a point, s: the shortest that is allowed, or the number of cycles."""
        return max(self.record_s, self.cycles / frequency)


SILENT = 8.0  # standard uncertainties that a tone must stand out of the noise


def clocks_of(records: Sequence[ProcedureRecord], axis: int) -> dict[str, tuple[float, float]]:
    """Departure of each device's clock from the reference's as a share, and its standard uncertainty, over all points."""
    departures: dict[str, list[tuple[float, float]]] = {}
    for record in records:
        frequency = record.step.setting["frequency_hz"]
        for unit, channel in record.samples.items():
            if unit == REFERENCE:
                continue
            y = channel.output[:, axis : axis + 1]
            if not np.all(np.isfinite(y)) or float(np.ptp(y)) == 0.0:
                continue
            tone = fit_tone_and_frequency(y, channel.rate_hz, frequency, harmonics=HARMONICS)
            if abs(tone.value[0]) > SILENT * tone.amplitude_error[0]:
                departures.setdefault(unit, []).append(
                    (frequency / tone.frequency - 1.0, tone.frequency_error / frequency)
                )
    clocks: dict[str, tuple[float, float]] = {}
    for unit, values in departures.items():
        value, error = np.array(values).T
        middle = np.abs(value - np.median(value)) < 5e-3
        weight = error[middle] ** -2.0
        clocks[unit] = (float(np.sum(weight * value[middle]) / np.sum(weight)), float(np.sum(weight) ** -0.5))
    return clocks


def response_point(
    part: SweepPart,
    number: int,
    setting: Mapping[str, float],
    records: tuple[UnitRecord, UnitRecord],
    axis: int,
    clock: tuple[float, float],
    device: Device,
) -> dict[str, Any]:
    """One point of one unit: fits of tone and harmonics on both channels, with the device's clock known.

    Distortion of the exciter is not noise: it is fitted, and enters neither the uncertainty nor the coherence.
    """
    reference, answer = records
    frequency = setting["frequency_hz"]
    drive = fit_tone(reference.output, reference.rate_hz, frequency, harmonics=HARMONICS)
    tone = fit_tone(
        answer.output[:, axis : axis + 1], answer.rate_hz, frequency / (1.0 + clock[0]), harmonics=HARMONICS
    )
    ratio = tone.value[0] / drive.value[axis]
    size, level = abs(tone.value[0]), float(abs(drive.value[axis]))
    across = float(np.linalg.norm(np.abs(np.delete(drive.value, axis)))) / level
    noise = float(np.hypot(tone.amplitude_error[0] / max(size, 1e-300), drive.amplitude_error[axis] / level))
    transverse = 1e-2 * part.transverse_percent * across / np.sqrt(6.0)
    skew = 2.0 * np.pi * frequency * clock[1] * len(answer.output) / answer.rate_hz / 2.0
    magnitude = float(np.sqrt(noise**2 + transverse**2 + (1e-2 * part.repeatability_percent) ** 2))
    phase = float(np.sqrt(noise**2 + transverse**2 + np.radians(part.repeatability_deg) ** 2 + skew**2))
    silent = size <= SILENT * tone.amplitude_error[0]  # an output of constant zero has neither tone nor noise
    clipped = device.at_end(answer.output[:, axis]) > 0
    power = 0.5 * size**2
    valid = not silent and not clipped and bool(np.isfinite(ratio))
    return {
        "axis": part.axis,
        "series": "response",
        "point": number,
        "setting": frequency,
        "value": float(abs(ratio)) if valid else np.nan,
        "uncertainty": float(abs(ratio)) * magnitude if valid else np.nan,
        "phase_deg": float(np.degrees(np.angle(ratio))) if valid else np.nan,
        "phase_uncertainty_deg": float(np.degrees(phase)),
        "level_g": level,
        "record_s": len(answer.output) / answer.rate_hz,
        "coherence": power / max(power + float(tone.sigma[0]) ** 2, 1e-300),
        "distortion_percent": 100.0
        * float(harmonic_distortion(reference.output[:, [axis]], reference.rate_hz, frequency)[0]),
        "transverse_percent": 100.0 * across,
        "clock_ppm": 1e6 * clock[0],
        "clock_uncertainty_ppm": 1e6 * clock[1],
        "rate_hz": answer.rate_hz,
    }


def response_bands(
    part: Any,
    number: int,
    records: tuple[UnitRecord, UnitRecord],
    axis: int,
    device: Device,
    clock: tuple[float, float] = (0.0, 0.0),
) -> list[dict[str, Any]]:
    """The points of a record of a swept sine, random vibration or an impact: bands of its whole spectrum.

    A record whose output is constant or clipped gives a single point without a value.

    Parameters
    ----------
    part : of the recipe: axis, repeatability_percent, repeatability_deg
    clock : departure of the unit's clock from the reference's as a share, and its standard uncertainty
    """
    reference, answer = records
    drive, wave = reference.output[:, axis], answer.output[:, axis]
    about = {
        "axis": part.axis, "series": "response", "level_g": float(np.std(drive)), "record_s": len(wave) / answer.rate_hz,
        "distortion_percent": 0.0, "transverse_percent": 0.0, "clock_ppm": 1e6 * clock[0],
        "clock_uncertainty_ppm": 1e6 * clock[1],
        "rate_hz": answer.rate_hz,
    }  # fmt: skip
    if float(np.ptp(wave)) == 0.0 or device.at_end(wave) > 0:
        return [about | {"point": POINTS_OF_RECORD * number, "setting": np.nan, "value": np.nan}]
    late = float(answer.time[0] - reference.time[0])
    bands = frequency_response((drive, reference.rate_hz), (wave, answer.rate_hz / (1.0 + clock[0])), late_s=late)
    size = np.abs(bands.h1)
    magnitude = np.hypot(bands.error, 1e-2 * part.repeatability_percent)
    skew = np.pi * bands.frequency * clock[1] * len(wave) / answer.rate_hz
    phase = np.sqrt(bands.error**2 + np.radians(part.repeatability_deg) ** 2 + skew**2)
    rows = point_rows(
        **about,
        point=POINTS_OF_RECORD * number + np.arange(size.size),
        setting=bands.frequency,
        value=size,
        uncertainty=size * magnitude,
        phase_deg=np.degrees(np.angle(bands.h1)),
        phase_uncertainty_deg=np.degrees(phase),
        coherence=bands.coherence,
        h2=np.abs(bands.h2),
    )
    return list(rows)


def condition_texts(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Own clock, distortion and transverse motion against what is usually held."""
    texts: list[tuple[str, str]] = []
    clock, error = float(rows["clock_ppm"].iloc[0]), float(rows["clock_uncertainty_ppm"].iloc[0])
    if abs(clock) > max(5.0 * error, 5.0):
        text = f"{clock:+.0f} ± {2.0 * error:.1g} ppm (k = 2) against the reference; the sine fits use it"
        texts.append(("clock of the device", text))
    distortion, across = float(rows["distortion_percent"].max()), rows["transverse_percent"]
    limit = np.where(rows["setting"] <= 1000.0, 10.0, 30.0)
    if distortion > 5.0:
        texts.append(("distortion of the exciter", f"{distortion:.1f} %, at most 5 % is usually held"))
    if bool((across > limit).any()):
        at = float(rows["setting"].to_numpy(dtype=float)[int(np.argmax(across.to_numpy(dtype=float)))])
        text = f"{across.max():.0f} % at {at:.4g} Hz, at most 10 % to 1 kHz and 30 % above is usually held"
        texts.append(("transverse motion of the exciter", text))
    return texts


def transfer_points(rows: pd.DataFrame) -> Points:
    """Points of one unit as arrays of the science."""

    def column(name: str) -> Array:
        return rows[name].to_numpy(dtype=float)

    names = ("setting", "level_g", "temperature_C", "record_s", *(["pressure_hPa"] if "pressure_hPa" in rows else []))
    conditions = Conditions(*map(column, names))
    turn = np.exp(1j * np.radians(column("phase_deg")))
    value = np.asarray(column("value") * turn, dtype=np.complex128)
    share = column("uncertainty") / column("value")
    return Points(conditions, value, share, np.radians(column("phase_uncertainty_deg")))
