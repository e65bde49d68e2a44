"""Transverse sensitivity on an exciter: the units are turned about their sensitive axis in steps, and a sine is fitted."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.dynamics.missing_effects import adequate
from inertial.dynamics.sine_fit import HARMONICS, fit_tone, fit_tone_and_frequency
from inertial.dynamics.transverse import Z95, Transverse, fit_transverse, relative_phase
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, level
from pipelines.procedures.base import Compares, InG, NominalScale, OnEquipment, refuse_broken_turn, scale_of
from pipelines.procedures.compared import ComparedResult, JudgedCurve, by_share, verdict_word, without
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome, verdict_of
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureRecord,
    ProcedureStep,
    Records,
    UnitRecord,
    numbers,
    on_equipment,
    point_table,
)
from schemas.bounds import NotNegative, Positive
from schemas.recipe import Recipe
from schemas.units import AXES

FEWEST_ANGLES = 8
SILENT = 8.0  # standard uncertainties by which a tone must exceed the noise to give the clock
FIGURE = "transverse_sensitivity_percent"


class TransversePart(NominalScale):
    """Motion across ``axis`` while the units are turned about it through a whole circle in steps of ``step_deg``.

    Uncertainties are standard ones: ``reference_percent`` is the reference's, as a share of the result; ``scale_percent`` is that
    of the nominal scale, where no calibration precedes; ``repeatability_ppm`` is each angle's own, of the driven acceleration.
    """

    kind: Literal["transverse"]
    axis: Literal["x", "y", "z"] = "z"
    step_deg: Annotated[Positive, Field(le=45.0)] = 30.0
    frequency_hz: Annotated[Positive, Field(ge=1.0, le=5000.0)] = 80.0
    level_g: Annotated[Positive, Field(le=50.0)] = 2.0
    record_s: Annotated[Positive, Field(ge=0.05, le=60.0)] = 0.5
    reference_percent: NotNegative = 0.25
    scale_percent: NotNegative = 1.0
    repeatability_ppm: NotNegative = 5.0

    @model_validator(mode="after")
    def _whole_circle(self) -> Self:
        refuse_broken_turn(self.step_deg, FEWEST_ANGLES, " (ISO 16063-31); use 15, 30, 36 or 45")
        return self


class TransverseTest(InG, OnEquipment, Compares):
    """The output of the sensitive axis under motion across it, over the angle of the unit about that axis."""

    title = "Transverse sensitivity"
    order = 114
    states = "largest transverse sensitivity in % of the sensitivity, and its direction"
    source = "ISO 16063-31 (transverse vibration sensitivity), 8 angles or more, fit of a sine"
    roles = ("exciter",)
    part = TransversePart
    figures = (
        FigureSpec(FIGURE, "%", "largest transverse sensitivity over the angle, of the sensitivity on the axis"),
    )

    def steps(self, part: TransversePart, recipe: Recipe) -> list[ProcedureStep]:
        """One dwell at each angle."""
        axis = float(AXES.index(part.axis))
        motion = {"frequency_hz": part.frequency_hz, "level_g": part.level_g, "axis": axis}
        angles = [k * part.step_deg for k in range(round(360.0 / part.step_deg))]
        return [
            on_equipment(
                "exciter", f"across {part.axis}, {angle:g}°", part, part.record_s, {**motion, "angle_deg": angle}
            )
            for angle in angles
        ]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The dwell on the exciter."""
        setting = step.setting
        level, angle, seconds = setting["level_g"], setting["angle_deg"], step.lasting_s or 0.0
        return equipment.sine_across(setting["frequency_hz"], level, int(setting["axis"]), angle, seconds, slots)

    def missing_axes(self, part: TransversePart, letters: Sequence[str]) -> list[str]:
        """The response across is that of the other axes."""
        return [axis for axis in AXES if axis not in letters]

    def reduce(self, part: TransversePart, records: Records, device: Device) -> pd.DataFrame:
        """In-phase output of the axis over the driven acceleration, in %, at every angle."""
        rows: list[dict[str, Any]] = []
        units = list(dict.fromkeys(str(unit) for record in records for unit in record.readings["unit"]))
        for unit in units:
            recorded = [(k, record) for k, record in enumerate(records) if unit in record.samples]
            tones = [_tones(part, record, record.samples[unit], scale_of(part, device, unit)) for _, record in recorded]
            turns = _turns(tones)
            for (k, record), (drive, answer, noise, responds), turn in zip(recorded, tones, turns, strict=True):
                rows.append(_point(part, k, record, (drive, answer, noise), turn, responds=responds) | {"unit": unit})
        return point_table(rows)

    def of_unit(self, part: TransversePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The maximum and its direction."""
        fit = fitted(rows)
        value = 100.0 * fit.value
        known = device.scale_error.get(unit)
        scale = part.scale_percent if known is None else 100.0 * float(known[AXES.index(part.axis)])
        share = 1e-2 * float(np.hypot(part.reference_percent, scale)) * value
        error = float(np.hypot(100.0 * fit.error, share))
        low, high = value - Z95 * error, value + Z95 * error
        figure = FigureValue(FIGURE, part.axis, value, error, max(0.0, low) if fit.low > 0.0 else 0.0, high)
        return [figure], _texts(part, fit)

    def compared(
        self, part: TransversePart, rows: pd.DataFrame, figures: Mapping[str, FigureValue], out_unit: str
    ) -> tuple[list[ComparedResult], list[JudgedCurve]]:
        """The maximum, and its direction where it is significant; the sine as the model that they rest on."""
        fit, figure = fitted(rows), figures[FIGURE]
        noise = 100.0 * fit.error
        at: dict[str, Any] = {"setting": part.frequency_hz, "dof": float(fit.dof) or float("inf")}
        scale = without(figure.uncertainty, noise, 1e-2 * part.reference_percent * figure.value)
        terms = by_share(figure.value, ("reference", "drift", "amplitude"))
        noises = {"noise": noise, "nominal_scale": scale}
        results = [ComparedResult("transverse_sensitivity", part.axis, "%", figure.value, noises, terms, **at)]
        if fit.direction_error_deg < 180.0:
            angle = {"noise": fit.direction_error_deg}
            results.append(
                ComparedResult("transverse_direction", part.axis, "°", fit.direction_deg % 360.0, angle, **at)
            )
        curve = JudgedCurve(part.axis, "sine over the angle", verdict_word(adequate(fit)), fit.p_value)
        return results, [curve]

    def chart(self, part: TransversePart, points: pd.DataFrame) -> Chart:
        """Output over the angle with its uncertainty, the fitted sine, and the direction of the maximum."""
        measured = points[np.isfinite(points["value"])]
        setting, value, error = numbers(measured)
        traces = [Trace("measured, U (k = 2)", setting, value, error=2.0 * error)]
        if len(measured) >= FEWEST_ANGLES:
            fit = fitted(points)
            angle = np.linspace(0.0, 360.0, 361)
            wave = 100.0 * (fit.value * np.cos(np.radians(angle - fit.direction_deg)) + fit.offset)
            traces.append(Trace("fitted sine", angle, wave, "line", "before"))
            traces.append(level(angle, 100.0 * fit.offset, name="motion along the axis"))
        first = AXES[(AXES.index(part.axis) + 1) % 3]
        along = PlotAxis(f"direction of motion from {first} / °", step=45.0)
        return Chart(
            self.title, (Plot("", along, PlotAxis(f"output of {part.axis} / % of the motion"), tuple(traces)),)
        )


def fitted(rows: pd.DataFrame) -> Transverse:
    """The sine through the points of one unit that have a value."""
    measured = rows[np.isfinite(rows["value"])]
    if len(measured) < max(FEWEST_ANGLES, 0.8 * len(rows)):
        msg = f"{len(measured)} of {len(rows)} angles have a value, four fifths are needed; check cable and range"
        raise NotIdentified(msg)
    first, second, value, error = numbers(measured, "first", "second", "value", "uncertainty")
    return fit_transverse(first, second, 1e-2 * value, 1e-2 * error)


def _tones(
    part: TransversePart, record: ProcedureRecord, channels: UnitRecord, scale: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """Tones (3,) of the reference and of the unit in g, standard uncertainties of their difference (3,), whether it responds.

    The frequency on the clock of the device is that of its strongest channel.
    """
    reference = record.samples[REFERENCE]
    drive = fit_tone(reference.output, reference.rate_hz, part.frequency_hz, harmonics=HARMONICS)
    output = channels.output / scale
    alive = bool(np.all(np.isfinite(output)) and np.ptp(output[:, AXES.index(part.axis)]) > 0.0)
    frequency = part.frequency_hz
    seen = False
    if alive:
        strongest = int(np.argmax(output.std(axis=0)))
        tone = fit_tone_and_frequency(output[:, [strongest]], channels.rate_hz, part.frequency_hz)
        seen = abs(tone.value[0]) > SILENT * tone.amplitude_error[0]
        frequency = tone.frequency if seen else frequency
    shown = output if alive else np.zeros_like(output)
    answer = fit_tone(shown, channels.rate_hz, frequency, harmonics=HARMONICS)
    # the motion along the axis that the reference measures is subtracted, with its noise
    return drive.value, answer.value, np.hypot(answer.amplitude_error, drive.amplitude_error), alive and seen


def _turns(tones: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray, bool]]) -> np.ndarray:
    """Phase factor (records,) that turns the unit into phase with the reference; 1 where the unit does not respond."""
    seen = np.array([responds for *_, responds in tones], dtype=bool)
    turns = np.ones(len(tones), dtype=np.complex128)
    if np.count_nonzero(seen) >= FEWEST_ANGLES:
        drive, answer = (np.array([tone[k] for tone in tones])[seen] for k in (0, 1))
        turns[seen] = relative_phase(drive, answer)
    return turns


def _point(
    part: TransversePart,
    number: int,
    record: ProcedureRecord,
    tones: tuple[np.ndarray, np.ndarray, np.ndarray],
    turn: complex,
    *,
    responds: bool,
) -> dict[str, Any]:
    """One angle of one unit: the part along the axis that the reference measures is subtracted."""
    drive, answer, noise = tones
    axis = AXES.index(part.axis)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    angle = record.step.setting["angle_deg"]
    driven = drive[first] * np.cos(np.radians(angle)) + drive[second] * np.sin(np.radians(angle))
    ratio = float(np.real(answer[axis] * turn / driven) - np.real(drive[axis] / driven))
    # noise of the phase moves what is subtracted by the motion along the axis that is in quadrature
    quadrature = abs(np.imag(drive[axis] / driven)) * float(np.hypot(noise[first], noise[second])) / np.sqrt(2.0)
    noise_u = float(np.hypot(noise[axis], quadrature)) / abs(driven)
    error = float(np.hypot(noise_u, 1e-6 * part.repeatability_ppm))
    return {
        "axis": part.axis,
        "series": "across",
        "point": number,
        "setting": angle,
        "value": 100.0 * ratio if responds else np.nan,
        "uncertainty": 100.0 * error if responds else np.nan,
        "first": float(np.real(drive[first] / driven)),
        "second": float(np.real(drive[second] / driven)),
        "along_percent": 100.0 * float(abs(drive[axis] / driven)),
    }


def _texts(part: TransversePart, fit: Transverse) -> list[tuple[str, str]]:
    axis = AXES.index(part.axis)
    first, second = AXES[(axis + 1) % 3], AXES[(axis + 2) % 3]
    if fit.direction_error_deg >= 180.0:
        text = "the transverse sensitivity is not significant against its uncertainty; raise level_g, or record longer"
        out = [("direction not determined", text)]
    else:
        text = f"{fit.direction_deg:.1f}° ± {2.0 * fit.direction_error_deg:.1g}° (k = 2) from {first} towards {second}"
        out = [("direction of the largest transverse sensitivity", text)]
    text = "a sine over the angle cannot be judged: no degree of freedom is left; measure at more angles"
    if np.isfinite(fit.p_value):
        remedy = "; check the angles of the fixture and its resonance, repeat at another frequency"
        text = f"a sine over the angle {verdict_of(fit)}{remedy if adequate(fit) is False else ''}"
    return [*out, ("model", text)]


PROCEDURE = TransverseTest()
