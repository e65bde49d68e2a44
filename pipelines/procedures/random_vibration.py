"""Random vibration by a profile: density of the reference, transfer function, and vibration rectification of the units."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, field_validator, model_validator
from scipy.signal import welch

from inertial.dynamics.frequency_response import clock_departure
from inertial.dynamics.spectra import (
    HANN_HALF,
    density_confidence,
    hann_mean,
    interpolated,
    overall_level,
    rectification,
)
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis
from inertial.dynamics.transfer_effects import EFFECTS
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace
from pipelines.procedures.base import Compares, InG, NominalScale, OnEquipment, refuse_unknown_effects, scale_of
from pipelines.procedures.compared import ComparedResult, JudgedCurve, by_share, transfer_results
from pipelines.procedures.figures import FigureSpec, FigureValue, Texts, UnitOutcome, signed
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
    taken,
)
from pipelines.procedures.sweep_points import FEWEST_POINTS, condition_texts, response_bands, transfer_points
from pipelines.procedures.transfer_chart import bode_chart
from pipelines.procedures.transfer_figures import diagnosis_text, figures_of_model, judged_points
from schemas.bounds import NotNegative, Positive
from schemas.recipe import Recipe
from schemas.units import AXES, MICRO
from schemas.vibration_profile import load_vibration_profile, vibration_profiles

REST_S = 0.8  # used of the second of rest before and after
GUARD_S = 0.2  # left out at the ends of the vibration
LINE_DB, OVERALL = 3.0, 0.10  # tolerances of IEC 60068-2-64
SEGMENT_S = 0.2


class RandomVibrationPart(NominalScale):
    """Three levels or more, each with rest before and after in one recording; ``levels_g`` are overall g rms.

    ``effects`` is the model of the transfer function at the largest level. ``repeatability_percent`` and ``repeatability_deg``
    are standard uncertainties of each of its points beside the noise; ``transverse_percent`` is the largest transverse
    sensitivity of the device.
    """

    kind: Literal["random_vibration"]
    profile: str = "flat_20_2000"
    levels_g: Annotated[list[Positive], Field(min_length=3, max_length=20)] = Field(
        default_factory=lambda: [2.0, 4.0, 6.0]
    )
    seconds: Annotated[Positive, Field(ge=2.0, le=60.0)] = 10.0
    axis: Literal["x", "y", "z"] = "z"
    window_s: Positive = 10.0
    repeatability_percent: NotNegative = 0.1
    repeatability_deg: NotNegative = 0.06
    transverse_percent: NotNegative = 0.3
    effects: Annotated[list[str], Field(min_length=1, max_length=6)] = Field(
        default_factory=lambda: ["second_order", "delay"]
    )

    @field_validator("profile")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in vibration_profiles():
            raise ValueError(f"no vibration profile '{name}', {', '.join(vibration_profiles())} are there; choose one")
        return name

    @model_validator(mode="after")
    def _effects_known(self) -> Self:
        refuse_unknown_effects(self.effects, EFFECTS, "sweeps")
        return self


class RandomVibration(InG, OnEquipment, Compares):
    """Gaussian vibration by a profile."""

    title = "Random vibration"
    order = 115
    states = "rectification over g rms²; transfer function H1 with coherence and its model; density against tolerance"
    source = "IEC 60068-2-64 (tolerances), IEEE Std 1293 (rectification), Bendat and Piersol (H1); profiles in schemas/vibration"
    roles = ("exciter",)
    part = RandomVibrationPart
    figures = (
        FigureSpec(
            "vibration_rectification_ug_g2",
            "µg/g²",
            "shift of the mean by vibration over g rms², line through the origin",
        ),
        FigureSpec("random_bandwidth_hz", "Hz", "frequency at which the magnitude is 3 dB below that at rest", True),
        FigureSpec("random_natural_hz", "Hz", "undamped natural frequency of the adequate model", True),
        FigureSpec("random_damping", "1", "damping ratio of the adequate model", True),
    )

    def steps(self, part: RandomVibrationPart, recipe: Recipe) -> list[ProcedureStep]:
        """One recording at each level."""
        profile = vibration_profiles().index(part.profile)
        motion = {"axis": float(AXES.index(part.axis)), "profile": float(profile)}
        return [
            on_equipment(
                "exciter", f"{part.profile}, {level:g} g rms", part, part.seconds, {**motion, "level_g": level}
            )
            for level in part.levels_g
        ]

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording at one level of the controller's profile."""
        setting = step.setting
        profile = vibration_profiles()[int(setting["profile"])]
        return equipment.random(profile, setting["level_g"], int(setting["axis"]), step.lasting_s or 0.0, slots)

    def reduce(self, part: RandomVibrationPart, records: Records, device: Device) -> pd.DataFrame:
        """Shift of the mean of every unit at every level, and the density of the reference at the largest level."""
        axis = AXES.index(part.axis)
        rows: list[dict[str, Any]] = []
        for measured in taken(records):
            reference = measured.record.samples[REFERENCE]
            rate = reference.rate_hz
            first, last = (round(at * rate) for at in (1.0 + GUARD_S, 1.0 + part.seconds - GUARD_S))
            driven = reference.output[first:last, axis]
            level = float(np.sqrt(np.mean((driven - driven.mean()) ** 2)))
            output, scale = measured.samples.output[:, axis], scale_of(part, device, measured.unit)[axis]
            shift, error = _shift(output / scale, measured.samples.rate_hz, part.seconds)
            silent = float(np.std(output)) < 0.2 * level * scale
            rows.append(
                {
                    "unit": measured.unit, "axis": part.axis, "series": "shift", "point": measured.number, "setting": level,
                    "value": np.nan if silent else MICRO * shift, "uncertainty": MICRO * error,
                    "clipped": float(device.at_end(output)),
                    "ordered_g": measured.record.step.setting["level_g"],
                }
            )  # fmt: skip
            if measured.number == len(records) - 1:
                rows += _density(measured.unit, part.axis, driven, rate)
                about = {"unit": measured.unit, "temperature_C": part.temperature_C}
                rows += [row | about for row in _response(part, measured.number, (reference, measured.samples), device)]
        return point_table(rows)

    def of_unit(self, part: RandomVibrationPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Slope over g rms², its straightness tested; none where samples are clipped, which imitates it."""
        response, rows = rows[rows["series"] == "response"], rows[rows["series"] == "shift"]
        clipped = int(rows["clipped"].sum())
        if clipped:
            raise NotIdentified(
                f"{clipped} samples are clipped, which shifts the mean as rectification does; lower the levels, or choose a "
                "wider range"
            )
        if bool(rows["value"].isna().any()):
            raise NotIdentified("the output does not follow the vibration; check cable and mounting")
        value, spread, chi_square = rectification(*numbers(rows))
        text = f"χ² {chi_square:.2g} for {len(rows) - 1} degrees of freedom of the line through the origin over g rms²"
        transfer, texts = _transfer(part, response)
        return [FigureValue(self.figures[0].name, part.axis, value, spread), *transfer], [
            ("straightness", text),
            *texts,
        ]

    def compared(
        self, part: RandomVibrationPart, rows: pd.DataFrame, figures: Mapping[str, FigureValue], out_unit: str
    ) -> tuple[list[ComparedResult], list[JudgedCurve]]:
        """Rectification, whose level counts twice; the transfer function with its judged model where it is determined."""
        slope = figures[self.figures[0].name]
        first = ComparedResult("vibration_rectification", part.axis, "µg/g²", slope.value, {"noise": slope.uncertainty},
                               by_share(2.0 * abs(slope.value)))  # fmt: skip
        response = rows[(rows["series"] == "response") & np.isfinite(rows["value"])]
        if len(response) < FEWEST_POINTS:
            return [first], []
        try:
            results, curves = transfer_results(part, _diagnosis(part, response), response, out_unit)
        except NotIdentified:
            return [first], []
        return [first, *results], curves

    def of_lot(self, part: RandomVibrationPart, points: pd.DataFrame) -> Texts:
        """Overall level and lines against their tolerances, with the confidence of a line."""
        shift = points[points["series"] == "shift"]
        if shift.empty:
            return []
        first = shift[shift["unit"] == shift["unit"].iloc[0]]
        actual, ordered = numbers(first, "setting", "ordered_g")
        ratio = actual / ordered
        density = points[(points["series"] == "density") & (points["unit"] == shift["unit"].iloc[0])]
        f, value = numbers(density, "setting", "value")
        target = _target(part, points, f)
        inside = target > 0.0
        apart = 10.0 * np.log10(value[inside] / target[inside])
        low, high = density_confidence(float(density["averages"].iloc[0]))
        beyond = float(np.mean(np.abs(apart) > LINE_DB))
        text = (
            f"overall level {signed(100.0 * (ratio.min() - 1.0), 1)} to {signed(100.0 * (ratio.max() - 1.0), 1)} % from the "
            f"order (± {100.0 * OVERALL:.0f} % allowed); {100.0 * beyond:.1f} % of the lines beyond ± {LINE_DB:g} dB; 99 % of "
            f"the lines of a right level lie within {signed(low, 1)} to {signed(high, 1)} dB"
        )
        return [("level of the reference", text)]

    def chart(self, part: RandomVibrationPart, points: pd.DataFrame) -> Chart:
        """Density of the reference with the tolerance band, and the shift of the mean over g rms²."""
        density = points[points["series"] == "density"]
        f, value = numbers(density, "setting", "value")
        target = _target(part, points, f)
        inside = target > 0.0
        low, high = (target[inside] * 10.0 ** (sign * LINE_DB / 10.0) for sign in (-1.0, 1.0))
        frequency = PlotAxis("frequency / Hz", log=True, low=0.7 * float(f[inside][0]), high=1.3 * float(f[inside][-1]))
        least, most = 0.03 * float(target[inside].min()), 8.0 * float(target.max())
        left = Plot(
            "",
            frequency,
            PlotAxis("density / (g²/Hz)", log=True, low=least, high=most),
            (
                Trace("± 3 dB", f[inside], low, "band", "ink", high=high),
                Trace("reference", f, value, "line", width=0.9),
            ),
        )
        shift = points[points["series"] == "shift"]
        rms, value, error = numbers(shift)
        traces = [Trace("measured, U (k = 2)", rms**2, value, error=2.0 * error)]
        if np.isfinite(value).all():
            ends = np.array([0.0, float((rms**2).max())])
            traces.append(
                Trace("line through the origin", ends, rectification(rms, value, error)[0] * ends, "line", "before")
            )
        right = Plot("", PlotAxis("level² / g²"), PlotAxis("shift of the mean / µg"), tuple(traces))
        response = points[(points["series"] == "response") & np.isfinite(points["value"])]
        if len(response) < FEWEST_POINTS:
            return Chart(self.title, (left, right), 2)
        diagnosis = _diagnosis(part, response)
        bode = bode_chart(transfer_points(response), diagnosis, numbers(response, "coherence")[0])
        return Chart(self.title, (left, right, *bode.plots), 2)


def _response(
    part: RandomVibrationPart, number: int, pair: tuple[UnitRecord, UnitRecord], device: Device
) -> list[dict[str, Any]]:
    """The points of the transfer function at one level, by the clock of the reference; none of an output that is constant."""
    first, last = 1.0 + GUARD_S, 1.0 + part.seconds - GUARD_S
    cut: list[UnitRecord] = []
    for channel in pair:
        a, b = (round(at * channel.rate_hz) for at in (first, last))
        cut.append(UnitRecord(channel.time[a:b], channel.output[a:b]))
    axis = AXES.index(part.axis)
    if float(np.ptp(cut[1].output[:, axis])) == 0.0:
        return []
    try:
        clock = clock_departure(*((channel.output[:, axis], channel.rate_hz) for channel in cut))
        points = response_bands(part, number, (cut[0], cut[1]), axis, device, clock)
    except NotIdentified:
        return []
    profile = np.array(load_vibration_profile(part.profile).breakpoints)[:, 0]
    return [point for point in points if not (point["setting"] < profile[0] or point["setting"] > profile[-1])]


def _diagnosis(part: RandomVibrationPart, response: pd.DataFrame) -> TransferDiagnosis:
    return judged_points(transfer_points(response), part.effects, 10000.0)


def _transfer(part: RandomVibrationPart, response: pd.DataFrame) -> tuple[list[FigureValue], list[tuple[str, str]]]:
    """Figures and findings of the transfer function, judged as that of a sweep."""
    names = ("random_bandwidth_hz", "random_natural_hz", "random_damping")
    measured = response[np.isfinite(response["value"])]
    note = f"{len(measured)} bands follow the vibration, {FEWEST_POINTS} are needed; check cable and range"
    if len(measured) >= FEWEST_POINTS:
        try:
            diagnosis = _diagnosis(part, measured)
        except NotIdentified as problem:
            note = str(problem)
        else:
            made = figures_of_model(part.axis, diagnosis, transfer_points(measured), "random")
            return made, [*diagnosis_text(diagnosis), *condition_texts(measured)]
    return [FigureValue.not_determined(name, part.axis, note) for name in names], []


def _shift(output: np.ndarray, rate_hz: float, seconds: float) -> tuple[float, float]:
    """Hann-weighted mean in vibration minus the mean at rest, g; standard uncertainty from the noise at rest."""
    n = round(REST_S * rate_hz)
    begin, end = round((1.0 + GUARD_S) * rate_hz), round((1.0 + seconds - GUARD_S) * rate_hz)
    before, after = output[:n], output[-n // 2 :]
    rest = 0.5 * (before.mean() + after.mean())
    noise = float(np.hypot(before.std(ddof=1) / np.sqrt(before.size), after.std(ddof=1) / np.sqrt(after.size)) / 2.0)
    during = float(hann_mean(output[begin:end][:, None])[0])
    white = float(before.std(ddof=1)) * np.sqrt(
        1.5 / (end - begin)
    )  # a Hann weight has 1.5 times the variance of a plain mean
    return during - rest, float(np.hypot(noise, white))


def _density(unit: str, axis: str, driven: np.ndarray, rate_hz: float) -> list[dict[str, Any]]:
    """Density of the reference up to 2.2 kHz, thinned to lines of the segments."""
    segment = round(SEGMENT_S * rate_hz)
    f, p = welch(driven, rate_hz, nperseg=segment, noverlap=segment // 2)
    count = HANN_HALF * ((driven.size - segment // 2) // (segment - segment // 2))
    inside = (f >= 1.0) & (f <= 2200.0)
    return point_rows(
        unit=unit,
        axis=axis,
        series="density",
        point=np.arange(np.count_nonzero(inside)),
        setting=f[inside],
        value=p[inside],
        uncertainty=p[inside] * (1.0 / np.sqrt(count)),
        averages=float(count),
    )


def _target(part: RandomVibrationPart, points: pd.DataFrame, f: np.ndarray) -> np.ndarray:
    """The ordered density at the largest level."""
    profile = np.array(load_vibration_profile(part.profile).breakpoints)
    nominal = overall_level(profile[:, 0], profile[:, 1])
    level = float(points.loc[points["series"] == "shift", "ordered_g"].iloc[-1])
    return interpolated(f, profile[:, 0], profile[:, 1]) * (level / nominal) ** 2


PROCEDURE = RandomVibration()
