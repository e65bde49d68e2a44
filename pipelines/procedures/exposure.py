"""Shift of bias and scale by an exposure: six poses, a profile of temperature, humidity and pressure, the same poses again."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.dynamics.exposure import ExposureShift, exposure_shift, temperature_slope
from inertial.dynamics.stability import error_of_mean, short_noise
from inertial.errors import NotIdentified
from inertial.frames import force_from_angles
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Trace, level
from pipelines.procedures.base import InG, OnEquipment, RecordByRecord, scale_of
from pipelines.procedures.climate import LEG, ROLE, expose
from pipelines.procedures.exposure_steps import AFTER, BEFORE, BETWEEN, DRY, FACES, SAME_K, ExposurePart, steps_of
from pipelines.procedures.figures import FigureSpec, FigureValue, Texts, UnitOutcome, worst
from pipelines.procedures.recorded import (
    REFERENCE,
    Device,
    ProcedureStep,
    Taken,
    noise_columns,
    numbers,
    point_rows,
    pooled_noise,
)  # fmt: skip
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import AXES, MICRO, axes_among

BIAS, SCALE = "exposure_bias_shift_ug", "exposure_scale_shift_ppm"
BIAS_IN, SCALE_IN = "exposure_bias_change_ug", "exposure_scale_change_ppm"
TAIL = 0.1  # of a leg, over which what the air has reached is the mean
UNLIKE = (
    "no records in the room's air at the temperatures of those in the environment; check the thermometers of the units"
)
PLAIN = "the profile sets nothing but the temperature, of which the change is no figure of it"


class Slope(NamedTuple):
    """Change with temperature (4,) per K at a temperature, and its standard error; zero where it is not known."""

    value: Array
    u: Array
    at_C: float

    def to_one(self, rows: pd.DataFrame, values: Array) -> Array:
        """Values (n,) of the records at the temperature of the slope."""
        columns = np.column_stack([np.ones(len(rows)), force_of(rows)])
        return values - columns @ self.value * (rows["temperature"].to_numpy(dtype=float) - self.at_C)


class Corrected(NamedTuple):
    """Records before and after of one axis, their values (n,) at one temperature, and the slope by which they are corrected.

    ``why`` they are not corrected; empty where they are.
    """

    still: pd.DataFrame
    output: Array
    slope: Slope
    why: str


def corrected(rows: pd.DataFrame, *, plain: bool) -> Corrected:
    """The change of bias and response with temperature taken out of one axis.

    It is that of the records in the room's air before the exposure and, where the exposure is one of temperature alone
    (``plain``), of those in it. The records after it are left out: a shift is no change with temperature.
    """
    still = rows[rows["series"].isin([BEFORE, AFTER])]
    known = rows[rows["series"].isin([BEFORE, DRY, *([BETWEEN] if plain else [])])]
    temperature, output = numbers(still, "temperature", "value")
    at, value = numbers(known, "temperature", "value")
    middle = float(temperature.mean()) if temperature.size else float("nan")
    try:
        found = temperature_slope(force_of(known), value, at, middle)
    except NotIdentified as problem:
        return Corrected(still, output, Slope(np.zeros(4), np.zeros(4), 0.0), str(problem))
    slope = Slope(found.value, found.u, middle)
    return Corrected(still, slope.to_one(still, output), slope, "")


def in_environment(rows: pd.DataFrame, slope: Slope) -> list[tuple[pd.DataFrame, Array, Flags]]:
    """For each soak of one axis in the environment its records beside those in the room's air at its temperature.

    Values (n,) are at the mean temperature of the soak; flags (n,) say which records are in the environment.
    """
    inside, dry = rows[rows["series"] == BETWEEN], rows[rows["series"].isin([BEFORE, DRY])]
    pairs: list[tuple[pd.DataFrame, Array, Flags]] = []
    for start in range(0, len(inside), len(FACES)):
        wet_rows = inside.iloc[start : start + len(FACES)]
        at = float(wet_rows["temperature"].mean())
        same = dry[np.abs(dry["temperature"] - at) < 2.0 * SAME_K]
        if same.empty:
            continue
        both = pd.concat([same, wet_rows])
        wet = (both["series"] == BETWEEN).to_numpy()
        pairs.append((both, slope._replace(at_C=at).to_one(both, numbers(both, "value")[0]), wet))
    return pairs


def force_of(rows: pd.DataFrame) -> Array:
    """The three forces (n, 3) of records, g."""
    return rows[[f"force_{axis}" for axis in AXES]].to_numpy(dtype=float)


class Exposure(InG, OnEquipment, RecordByRecord):
    """A profile of the environment between two measurements in six poses."""

    title = "Exposure to an environment"
    order = 65
    states = (
        "shift of bias and scale by cycles or shocks of temperature, damp heat or low pressure, at the same temperature and in "
        "the same poses before and after; their change in the environment"
    )
    source = "IEC 60068-2-13, -2-14, -2-30; MIL-STD-810 methods 500, 503, 507; RTCA DO-160G section 5: schemas/exposure"
    roles = (ROLE,)
    part = ExposurePart
    figures = (
        FigureSpec(BIAS, "µg", "bias after the exposure minus that before, worst axis"),
        FigureSpec(SCALE, "ppm", "relative change of the scale by the exposure, worst axis"),
        FigureSpec(
            BIAS_IN, "µg", "largest change of the bias in damp air or at low pressure from that in the room's air"
        ),
        FigureSpec(SCALE_IN, "ppm", "the same change of the scale"),
    )

    def roles_for(self, part: Any) -> tuple[str, ...]:
        """A climate unit, where the chamber alone cannot carry out the profile."""
        return self.roles if part.stated.by_unit else ()

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse temperatures and faces outside the limits of the station, and a recipe without a scale."""
        super().check(part, recipe, station)
        limits = station.limits
        wanted = [
            (key, value, "°C", limits.temperature_C, "temperatures within, or another chamber")
            for key, value in part.temperatures().items()
        ]
        for face, (outer, inner) in FACES.items():
            for axis, angle, allowed in (("outer", outer, limits.outer_deg), ("inner", inner, limits.inner_deg)):
                wanted.append((f"face {face}: {axis} axis", angle, "deg", allowed, "a table that turns so far"))
        for what, value, unit, (low, high), other in wanted:
            if not low <= value <= high:
                raise RecipeInvalid(
                    f"recipe: procedure exposure: {what} {value:g} {unit}, {low:g} to {high:g} {unit} is allowed by the station; "
                    f"take {other}",
                    key=what if hasattr(part, what) else "kind",
                )

    def steps(self, part: ExposurePart, recipe: Recipe) -> list[ProcedureStep]:
        """Six poses several times before, once at every measured leg, several times after; the legs between them."""
        return steps_of(part)

    def measure(self, equipment: Any, step: ProcedureStep, slots: Sequence[int]) -> Any:
        """The recording of a leg of the profile."""
        return expose(equipment, step, slots)

    def points(self, part: ExposurePart, taken: Taken, device: Device) -> list[dict[str, Any]]:
        """Mean of a record in µg with its time, temperature and force, and the noise of its samples; of a leg what it was."""
        letters = taken.samples.letters
        output = taken.samples.output / scale_of(part, device, taken.unit)[: len(letters)] * MICRO
        if taken.record.step.role:
            return _leg_rows(taken, output)
        angles = (np.radians(float(taken.reading[name])) for name in ("outer_deg", "inner_deg"))
        force = force_from_angles(*angles)
        noise = [noise_columns(short_noise(output[:, i], taken.samples.rate_hz)) for i in range(len(letters))]
        series = taken.record.step.name.split()[0]
        return point_rows(
            unit=taken.unit,
            axis=letters,
            series=series if series in {BEFORE, AFTER, DRY} else BETWEEN,
            point=taken.number,
            setting=float(taken.samples.time.mean()),
            value=[output[:, i].mean() for i in range(len(letters))],
            uncertainty=error_of_mean(output),
            temperature=float(taken.reading["unit_C"]),
            **{f"force_{axis}": float(force[i]) for i, axis in enumerate(AXES)},
            **{name: [each[name] for each in noise] for name in noise[0]},
        )

    def of_unit(self, part: ExposurePart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Shifts and changes of the worst axis; findings on the legs, and where the temperature is not corrected for."""
        found: dict[str, list[FigureValue]] = {spec.name: [] for spec in self.figures}
        texts = dict[str, str]()
        legs = rows[rows["series"] == LEG]
        if len(legs):
            most = legs.iloc[int(legs["value"].to_numpy(dtype=float).argmax())]
            away = f"{most['value']:.0f} µg, axis {most['axis']}"
            texts["in the legs"] = f"largest departure of the output at rest from the beginning of a leg: {away}"
        for axis, at_rest in rows[rows["series"] != LEG].groupby("axis", sort=False):
            still, settled, slope, why = corrected(at_rest, plain=not part.stated.conditioned)
            if why:
                texts["temperature"] = f"not corrected for, its difference is in both shifts and not in U: {why}"
            after = (still["series"] == AFTER).to_numpy()
            if not after.any() or after.all():
                raise NotIdentified(
                    f"exposure: no records {BEFORE if after.any() else AFTER} it, both are needed; check the unit and its seat"
                )
            _add(found, (BIAS, SCALE), str(axis), _shift(part, still, settled, after, str(axis)), slope, still, after)
            for during, values, wet in in_environment(at_rest, slope) if part.stated.conditioned else ():
                shift = _shift(part, during, values, wet, str(axis))
                _add(found, (BIAS_IN, SCALE_IN), str(axis), shift, slope, during, wet)
        missing = UNLIKE if part.stated.conditioned else PLAIN
        figures = [
            worst(values) if values else FigureValue.not_determined(name, "*", missing)
            for name, values in found.items()
        ]
        return figures, list(texts.items())

    def of_lot(self, part: ExposurePart, points: pd.DataFrame) -> Texts:
        """Findings on the distance of the air from the profile at the ends of its legs."""
        legs = points[points["series"] == LEG]
        if legs.empty:
            return []
        first = legs[(legs["unit"] == legs["unit"].iloc[0]) & (legs["axis"] == legs["axis"].iloc[0])]
        apart = [
            f"{np.nanmax(np.abs(first[f'reached_{unit}'] - first[f'ordered_{unit}'])):.2g} {text}"
            for unit, text in (("C", "K"), ("pct", "% of humidity"), ("hPa", "hPa"))
            if first[f"ordered_{unit}"].notna().any()
        ]
        return [
            ("profile", f"{part.profile}: {len(first)} legs, air at their ends within {', '.join(apart)} of the order")
        ]

    def chart(self, part: ExposurePart, points: pd.DataFrame) -> Chart:
        """Output of every record about that of its pose before the exposure."""
        traces: list[Trace] = []
        number = np.ones(1)
        for axis in axes_among(points["axis"]):
            at_rest = points[(points["axis"] == axis) & (points["series"] != LEG)]
            still, settled, *_ = corrected(at_rest, plain=not part.stated.conditioned)
            number = np.arange(1.0, len(still) + 1.0)
            before = (still["series"] == BEFORE).to_numpy()
            if not before.any():
                continue
            columns = np.column_stack([np.ones(len(still)), force_of(still)])
            fitted = columns @ np.linalg.lstsq(columns[before], settled[before], rcond=None)[0]
            error = still["uncertainty"].to_numpy(dtype=float)
            traces.append(Trace(f"axis {axis}", number, settled - fitted, role=axis, error=error))
        axes = (
            PlotAxis("record; the exposure lies in the middle"),
            PlotAxis("output minus that before the exposure / µg"),
        )
        return Chart(self.title, (Plot("", *axes, (*traces, level(number, 0.0))),))


def _leg_rows(taken: Taken, output: Array) -> list[dict[str, Any]]:
    """Points of a leg: air at its end against the order, and largest departure of the outputs (n, m), µg, from their begin."""
    air, step = taken.record.samples[REFERENCE].output, taken.record.step
    reached = air[-max(1, round(TAIL * len(air))) :].mean(axis=0)
    humidity = step.setting["humidity_pct"] or np.nan
    away = np.abs(output - output[0])
    return point_rows(
        unit=taken.unit,
        axis=taken.samples.letters,
        series=LEG,
        point=taken.number,
        setting=float(taken.samples.time.mean()),
        value=list(away.max(axis=0)),
        uncertainty=list(np.std(np.diff(output, axis=0), axis=0)) if len(output) > 1 else np.nan,
        temperature=float(reached[0]),
        **dict(zip(("reached_C", "reached_pct", "reached_hPa"), reached.tolist(), strict=True)),
        ordered_C=step.temperature_C,
        ordered_pct=humidity,
        ordered_hPa=step.setting["pressure_hPa"],
    )


def _shift(part: ExposurePart, rows: pd.DataFrame, values: Array, later: Flags, axis: str) -> ExposureShift:
    time = rows["setting"].to_numpy(dtype=float)
    window = float(np.ptp(time[~later])) + part.window_s
    apart = float(time[later].mean() - time[~later].mean())
    return exposure_shift(force_of(rows), values, later, AXES.index(axis), pooled_noise(rows), window, apart)


def _add(
    found: dict[str, list[FigureValue]],
    names: tuple[str, str],
    axis: str,
    shift: ExposureShift,
    slope: Slope,
    rows: pd.DataFrame,
    later: Flags,
) -> None:
    """The figures of a shift, with the error of the correction for the difference of temperature in U."""
    temperature = rows["temperature"].to_numpy(dtype=float)
    apart = abs(float(temperature[later].mean() - temperature[~later].mean())) if slope.u.any() else 0.0
    for name, change, row in zip(names, (shift.bias, shift.scale), (0, 1 + AXES.index(axis)), strict=True):
        found[name].append(
            FigureValue(name, axis, change.value, float(np.hypot(change.u, slope.u[row] * apart)))
        )  # µg/g: ppm


PROCEDURE = Exposure()
