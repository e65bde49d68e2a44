"""Sine comparison: stepped sine on an exciter against a reference sensor; transfer function, its model and its diagnosis."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics.sine_fit import fit_tone_and_frequency
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart
from pipelines.procedures.base import Compares, FromWaveforms, OnEquipment
from pipelines.procedures.climate import MINUTE_S, ROLE, Leg, expose, leg_step
from pipelines.procedures.compared import ComparedResult, JudgedCurve, transfer_results
from pipelines.procedures.figures import FigureSpec, FigureValue, UnitOutcome
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureStep,
    Records,
    UnitRecord,
    on_equipment,
    point_table,
    taken,
)
from pipelines.procedures.sweep_points import (
    FEWEST_POINTS,
    SweepPart,
    clocks_of,
    condition_texts,
    response_bands,
    response_point,
    transfer_points,
)
from pipelines.procedures.transfer_chart import bode_chart
from pipelines.procedures.transfer_figures import diagnosis_text, figures_of_transfer, judged_points, sampling_text
from schemas.errors import RecipeInvalid
from schemas.exposure_profile import AMBIENT_HPA
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.tables import NOT_JUDGED
from schemas.units import AXES

SINGLE_TONE = 0.7
"""Share of the power of a record that a stepped sine has in its largest tone; a sweep or random vibration has less."""


LAST = 6  # readings of the climate unit at the end of a leg: of a minute
PRESSURE_S, HOLD_S = 10.0 * MINUTE_S, 30.0 * MINUTE_S


def _leg(part: SweepPart, pressure: float) -> Leg:
    """The way to a pressure, and the time in which the gas in the units follows."""
    return Leg(part.temperature_C, None, pressure, PRESSURE_S, HOLD_S)


class Sweep(OnEquipment, FromWaveforms, Compares):
    """Stepped sine against a reference sensor."""

    title = "Sine comparison"
    order = 110
    states = (
        "transfer function with uncertainty, natural frequency, damping, −3 dB bandwidth, flatness, missing effects"
    )
    source = "ISO 16063-21 (comparison), ISO 16063-11 method 3 and IEEE Std 1057 (sine fit)"
    roles = ("exciter", ROLE)
    part = SweepPart
    figures = (
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
        """One dwell for each point, at each temperature and then at each pressure; the room's pressure again at the end."""
        axis = float(AXES.index(part.axis))
        dwells = [
            on_equipment("exciter", f"{frequency:.4g} Hz, {level:.3g} g", part, part.lasting(frequency), setting)
            for frequency, level in part.plan()
            for setting in ({"frequency_hz": frequency, "level_g": level, "axis": axis},)
        ]
        steps = list(dwells)
        for soak, at in enumerate(part.other_temperatures_C, start=1):
            steps += [replace(dwell, name=f"{at:g} °C, {dwell.name}", temperature_C=at, soak=soak) for dwell in dwells]
        for pressure in part.pressures_hPa:
            steps.append(leg_step(f"{pressure:g} hPa", _leg(part, pressure), steps[-1].soak + 1))
            soak = steps[-1].soak + 1
            steps += [replace(dwell, name=f"{pressure:g} hPa, {dwell.name}", soak=soak) for dwell in dwells]
        if part.pressures_hPa:
            steps.append(leg_step("room", _leg(part, AMBIENT_HPA), steps[-1].soak + 1))
        return steps

    def roles_for(self, part: SweepPart) -> tuple[str, ...]:
        """An exciter; a climate unit for points at other pressures."""
        return self.roles if part.pressures_hPa else self.roles[:1]

    def check(self, part: SweepPart, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a part without a scale to compare the sensitivity with."""
        if part.nominal_scale is None and not recipe.tumbles:
            raise RecipeInvalid(
                "recipe: procedure sweep has no scale to compare the sensitivity with; set nominal_scale (output per g), or list "
                "multi_position",
                key="nominal_scale",
            )
        low, high = station.limits.temperature_C
        for at in part.other_temperatures_C:
            if not low <= at <= high:
                raise RecipeInvalid(
                    f"recipe: procedure sweep: other_temperatures_C has {at:g} °C, {low:g} to {high:g} °C is allowed by the "
                    "station; take temperatures within, or another chamber",
                    key="other_temperatures_C",
                )

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The dwell on the exciter."""
        if step.role == ROLE:
            return expose(equipment, step, slots)
        setting = step.setting
        seconds = step.lasting_s or 0.0
        return equipment.sine(setting["frequency_hz"], setting["level_g"], int(setting["axis"]), seconds, slots)

    def setting_of(self, part: SweepPart, reference: UnitRecord) -> dict[str, float]:
        """Frequency and level of a dwell, from the largest tone of the reference; no frequency where there is no single tone."""
        axis = AXES.index(part.axis)
        wave = reference.output[:, [axis]] - reference.output[:, axis].mean()
        spectrum = np.abs(np.fft.rfft(wave[:, 0] * np.hanning(len(wave))))
        line = int(np.argmax(spectrum[1:])) + 1
        tone_power, power = np.sum(spectrum[max(line - 2, 1) : line + 3] ** 2), np.sum(spectrum[1:] ** 2)
        if tone_power < SINGLE_TONE * power:
            return {"frequency_hz": np.nan, "level_g": float(np.std(wave)), "axis": float(axis)}
        coarse = float(line) * reference.rate_hz / len(wave)
        tone = fit_tone_and_frequency(wave, reference.rate_hz, coarse)
        return {"frequency_hz": tone.frequency, "level_g": float(abs(tone.value[0])), "axis": float(axis)}

    def reduce(self, part: SweepPart, records: Records, device: Device) -> pd.DataFrame:
        """Magnitude, phase, and their uncertainty at every point; the device's clock is estimated from all points first."""
        axis = AXES.index(part.axis)
        pressures, now = dict[int, float](), np.nan
        for record in records:
            if record.step.role == ROLE:
                now = float(record.samples[REFERENCE].output[-LAST:, 2].mean())
            pressures[record.number] = now
        records = [record for record in records if record.step.role != ROLE]
        broadband = {id(r) for r in records if np.isnan(r.step.setting["frequency_hz"])}
        clocks = clocks_of([r for r in records if id(r) not in broadband], axis)
        rows: list[dict[str, Any]] = []
        for measured in taken(records):
            clock, pair = clocks.get(measured.unit, (0.0, 0.0)), (measured.record.samples[REFERENCE], measured.samples)
            if id(measured.record) in broadband:
                points = response_bands(part, measured.number, pair, axis, device)
            else:
                points = [
                    response_point(part, measured.number, measured.record.step.setting, pair, axis, clock, device)
                ]
            about = {"unit": measured.unit, "temperature_C": float(measured.reading["unit_C"])}
            if part.pressures_hPa:
                about["pressure_hPa"] = pressures[measured.record.number]
            rows += [point | about for point in points]
        return point_table(rows)

    def of_unit(self, part: SweepPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """The model, judged; figures of the adequate model, or as not determined with the reason."""
        measured = rows[np.isfinite(rows["value"])]
        texts: list[tuple[str, str]] = []
        if len(measured) < len(rows):
            text = f"{len(rows) - len(measured)} of {len(rows)} points give no tone, or are clipped: they are left out"
            texts.append(("points without a value", text))
        if len(measured) < max(FEWEST_POINTS, 0.8 * len(rows)):
            note = f"{len(measured)} of {len(rows)} points have a value, four fifths are needed; check cable and range"
            return self.nothing(part, note), texts
        try:
            diagnosis = judged(part, measured)
        except NotIdentified as problem:
            return self.nothing(part, str(problem)), texts
        figures = figures_of_transfer(part, diagnosis, transfer_points(measured), device.scale.get(unit))
        texts += [*diagnosis_text(diagnosis), *condition_texts(measured)]
        band = next(figure for figure in figures if figure.figure == "sweep_bandwidth_hz")
        if band.identified:
            texts.append(
                ("sampling", sampling_text(float(measured["rate_hz"].max()), band.value, part.bandwidth_order))
            )
        return figures, texts

    def compared(
        self, part: SweepPart, rows: pd.DataFrame, figures: Mapping[str, FigureValue], out_unit: str
    ) -> tuple[list[ComparedResult], list[JudgedCurve]]:
        """Magnitude and phase at every point, and the judged model through them."""
        measured = rows[np.isfinite(rows["value"])]
        if len(measured) < max(FEWEST_POINTS, 0.8 * len(rows)):
            return [], []
        try:
            diagnosis = judged(part, measured)
        except NotIdentified:
            return [], []
        return transfer_results(part, diagnosis, measured, out_unit)

    def verdict(self, part: SweepPart, rows: pd.DataFrame) -> str:
        """The verdict on the model of the transfer function."""
        curves = self.compared(part, rows, {}, "")[1]
        return curves[0].verdict if curves else NOT_JUDGED

    def chart(self, part: SweepPart, points: pd.DataFrame) -> Chart | None:
        """Magnitude with uncertainty, phase, coherence, and the residual of the model."""
        measured = points[np.isfinite(points["value"])]
        if len(measured) < FEWEST_POINTS:
            return None
        return bode_chart(
            transfer_points(measured), judged(part, measured), measured["coherence"].to_numpy(dtype=float)
        )


def judged(part: SweepPart, rows: pd.DataFrame) -> TransferDiagnosis:
    """The diagnosis of the part's model on the points of one unit."""
    return judged_points(transfer_points(rows), part.effects, max(part.high_hz, 10000.0))


PROCEDURE = Sweep()
