"""Constant-rate rotation in gravity: all coefficients within 1 g from a few turns, against the encoder of the table."""

from itertools import groupby
from typing import Any, cast

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.dynamics.missing_effects import DiagnosisInG
from inertial.dynamics.rotation import PLACE_M, RotationData, RotationFit
from inertial.dynamics.rotation_diagnosis import diagnose_rotation
from inertial.dynamics.rotation_effects import EFFECTS
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace, level
from pipelines.procedures.base import Evaluated, InG
from pipelines.procedures.figures import (
    FigureSpec,
    FigureValue,
    Texts,
    UnitOutcome,
    diagnosis_texts,
    with_uncertainty,
    worst,
)
from pipelines.procedures.recorded import Device, ProcedureStep, Records, Turn, point_table, taken
from pipelines.procedures.rotation_points import AT_REST, RotationPart, data_of, points_of_record
from schemas.errors import RecipeInvalid
from schemas.poses import Pose
from schemas.profile import limits_of
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.units import AXES, MICRO
from stations.profile_files import profile_of

MILLI = 1e3
SETTLING_S = 3.0  # of a turn besides its angle at the rate: running up and down, and in position
REACTION_S = 0.1  # in which the axis still settles at its rate
GAIN = "rate_gain"
SCATTER_DEG = 0.1  # largest scatter of the encoder's readings: then 300 of them know an angle to 0.1 mrad


class Rotation(InG, Evaluated):
    """Planes of the device turned through gravity at steady rates, both ways."""

    title = "Constant-rate rotation"
    order = 32
    states = (
        "bias, scale, misalignment, K2 and K3 within 1 g of all axes, delay of the encoder against the samples, radius of the "
        "proof masses, missing effects"
    )
    source = "Gaitan and Geist, Measurement 189 (2022) 110528; IEEE Std 1293; reference by gravity, ISO 16063-16"
    part = RotationPart
    figures = (
        FigureSpec("rotation_bias_ug", "µg", "bias at rest, worst axis"),
        FigureSpec(
            "rotation_scale_ppm", "ppm", "departure of the scale from that of the calibration, or scale, worst axis"
        ),
        FigureSpec(
            "rotation_misalignment_mrad", "mrad", "output by the force across an axis over that along it, worst pair"
        ),
        FigureSpec("rotation_second_order_ug_g2", "µg/g²", "K2 within 1 g, worst axis"),
        FigureSpec("rotation_third_order_ug_g3", "µg/g³", "K3 within 1 g, worst axis"),
        FigureSpec("rotation_delay_ms", "ms", "by which the readings of the encoder are later than the samples"),
        FigureSpec("rotation_response_percent", "%", "gain at the fastest turn less that at rest, worst axis"),
        FigureSpec("rotation_radius_mm", "mm", "of the proof masses about the inner axis of the table"),
    )

    def steps(self, part: RotationPart, recipe: Recipe) -> list[ProcedureStep]:
        """One record a plane: at rest, forward, at rest, back, and so on."""
        made: list[ProcedureStep] = []
        for plane in part.planes:
            axis, other = AT_REST[plane]
            # from this end of the turn the outer axis has less way between planes
            end = part.end_deg if axis == "inner" else -part.end_deg
            turns = tuple(
                Turn(axis, to, rate, part.stand_s)
                for rate in part.rates_deg_s
                for _ in range(part.times)
                for to in (end, -end)
            )
            pose = Pose(name=plane, **{f"{axis}_deg": -end, f"{'inner' if axis == 'outer' else 'outer'}_deg": other})
            lasting = (
                sum(2.0 * part.end_deg / turn.rate_deg_s + turn.stand_s + SETTLING_S for turn in turns) + part.stand_s
            )
            made.append(ProcedureStep(plane, pose, part.temperature_C, lasting_s=lasting, turns=turns))
        return made

    def check(self, part: Any, recipe: Recipe, station: StationConfig) -> None:
        """Refuse a table that cannot turn so far or so fast, and a table whose encoder delay is not stated."""
        super().check(part, recipe, station)
        for axis in sorted({AT_REST[plane][0] for plane in part.planes}):
            profile, limits = profile_of(getattr(station.devices, axis)), station.limits
            where = f"recipe: procedure rotation: {axis} axis of station {station.name}"
            if profile.encoder is None:
                raise RecipeInvalid(
                    f"{where}: profile {profile.name} does not state how late its encoder is read, a rotation needs it; add "
                    "encoder = { latency_ms = …, jitter_ms = … } to the profile, or measure with tilt or multi_position",
                    key="kind",
                )
            wide, low, high = getattr(limits, f"{axis}_deg"), *limits_of(profile.register("target"))
            low, high = max(wide[0], low), min(wide[1], high)
            if not low <= -part.end_deg < part.end_deg <= high:
                raise RecipeInvalid(
                    f"{where} turns from {low:g}° to {high:g}°, ±{part.end_deg:g}° is needed for {part.turns} whole turns with a "
                    "lead; lower turns or lead_deg, leave out a plane, or measure with tilt or multi_position",
                    key="turns",
                )
            fastest = min(limits.speed_deg_s, limits_of(profile.register("speed"))[1])
            rate = max(part.rates_deg_s)
            if rate > fastest:
                raise RecipeInvalid(
                    f"{where}: {rate:g} °/s, at most {fastest:g} °/s is allowed; lower rates_deg_s", key="rates_deg_s"
                )
            lead = rate**2 / (2.0 * limits.acceleration_deg_s2) + rate * (
                REACTION_S + 1e-3 * profile.encoder.latency_ms
            )
            if lead > part.lead_deg:
                raise RecipeInvalid(
                    f"{where}: {part.lead_deg:g}° before the whole turns, {lead:.1f}° are needed to reach {rate:g} °/s; raise "
                    "lead_deg, or lower rates_deg_s",
                    key="lead_deg",
                )
            scatter = 1e-3 * profile.encoder.jitter_ms * rate
            if scatter > SCATTER_DEG:
                raise RecipeInvalid(
                    f"{where}: readings of the encoder scatter by {scatter:.2g}° at {rate:g} °/s, at most {SCATTER_DEG:g}° is of "
                    "use; lower rates_deg_s",
                    key="rates_deg_s",
                )

    def reduce(self, part: RotationPart, records: Records, device: Device) -> pd.DataFrame:
        """Means over ten degrees of every sweep, and at rest, with what the encoder says of them."""
        each = groupby(taken(records), key=lambda measured: measured.number)
        return point_table(
            row
            for number, units in each
            for row in points_of_record(part, number, records[number], list(units), device)
        )

    def of_unit(self, part: RotationPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Figures of all axes, the coefficients in words, the drive, and the diagnosis."""
        data = data_of(rows)
        # matrices of some hundred rows: threads wait for each other longer than they compute
        with threadpool_limits(1):
            diagnosis = diagnose_rotation(data, part.effects)
        fit, letters = diagnosis.fit, data.letters
        figures = [
            worst([_figure("rotation_bias_ug", a, fit.of(f"bias_{a}"), MICRO) for a in letters]),
            worst([_figure("rotation_scale_ppm", a, fit.of(f"matrix_{a}{a}"), MICRO, 1.0) for a in letters]),
            worst([_misalignment(fit, a, b) for a in letters for b in AXES if a != b]),
            *(
                worst([_effect(figure, effect, fit, a) for a in letters])
                for figure, effect in (
                    ("rotation_second_order_ug_g2", "second_order"),
                    ("rotation_third_order_ug_g3", "third_order"),
                )
            ),
            worst(
                [
                    _figure("rotation_delay_ms", n.removeprefix("delay_"), fit.of(n), MILLI)
                    for n in fit.names
                    if n.startswith("delay_")
                ]
            ),
            _response(data, fit),
            _radius(fit),
        ]
        return figures, [*_coefficients(fit, letters), *_drive(part, rows), *_open(part), *_diagnosis(diagnosis)]

    def chart(self, part: RotationPart, points: pd.DataFrame) -> Chart | None:
        """Residual after bias, scale, misalignment, delay and position, over the angle of each plane, with the effects' curve."""
        if points.groupby("axis")["value"].nunique(dropna=True).min() < len(points) / 10:
            return None  # constant or clipped
        data = data_of(points)
        with threadpool_limits(1):
            model = data.model
            fit = model.fit([name for name in part.effects if model.seen(name)])
        curve = model.part_of_effects(fit)
        plots: list[Plot] = []
        for plane in part.planes:
            rows = points[points["axis"] == data.letters[0]].sort_values("time_s")
            turning = (rows["series"] == plane).to_numpy(dtype=bool) & data.points.turning
            angle = np.degrees(data.points.angle[turning])
            order = np.argsort(angle)
            traces = [level(np.array([-180.0, 180.0]), 0.0)]
            for k, axis in enumerate(data.letters):
                role, left = cast("Role", axis), (fit.residuals + curve)[turning, k]
                traces += [
                    Trace(f"axis {axis}", angle, MICRO * left, role=role, size=4.0),
                    Trace(f"effects on {axis}", angle[order], MICRO * curve[turning, k][order], "line", role),
                ]
            plots.append(
                Plot(f"plane {plane}", PlotAxis("angle / °", step=45.0), PlotAxis("residual / µg"), tuple(traces))
            )
        return Chart(self.title, tuple(plots))


def _figure(name: str, axis: str, estimate: tuple[float, float], factor: float, nominal: float = 0.0) -> FigureValue:
    return FigureValue(name, axis, factor * (estimate[0] - nominal), factor * estimate[1])


def _misalignment(fit: RotationFit, axis: str, other: str) -> FigureValue:
    across, along = fit.of(f"matrix_{axis}{other}"), fit.of(f"matrix_{axis}{axis}")
    slope = {f"matrix_{axis}{other}": 1.0 / along[0], f"matrix_{axis}{axis}": -across[0] / along[0] ** 2}
    error = MILLI * fit.of_function(slope)
    return FigureValue("rotation_misalignment_mrad", axis + other, MILLI * across[0] / along[0], error)


def _effect(figure: str, effect: str, fit: RotationFit, axis: str) -> FigureValue:
    if f"{effect}_{axis}" not in fit.names:
        return FigureValue.not_determined(figure, axis, f"the model has no {effect}; name it in effects")
    return _figure(figure, axis, fit.of(f"{effect}_{axis}"), MICRO)


def _felt(fit: RotationFit) -> list[str]:
    """Directions in which the test determines the position of the proof masses better than their stated range."""
    return [a for a in "xyz" if fit.of(f"place_{a}")[1] < 0.5 * PLACE_M]


def _response(data: RotationData, fit: RotationFit) -> FigureValue:
    """Gain of the response to rotation, from the model with that effect, whether or not the judged model has it."""
    model = data.model
    if not model.seen(GAIN):
        return FigureValue.not_determined(
            "rotation_response_percent", "*", "no axis turns in gravity at a rate and stands"
        )
    beside = model.fit([*dict.fromkeys([*fit.effects, GAIN])])
    axes = [(name.rsplit("_", 1)[1], beside.of(name)) for name in beside.of_effect(GAIN)]
    return worst([_figure("rotation_response_percent", axis, gain, 100.0) for axis, gain in axes])


def _radius(fit: RotationFit) -> FigureValue:
    if not {"x", "y"} <= set(_felt(fit)):
        note = "the axes of the device do not feel the pull towards the inner axis; measure with outputs x and y"
        return FigureValue.not_determined("rotation_radius_mm", "*", note)
    x, y = (fit.of(f"place_{a}")[0] for a in "xy")
    size = float(np.hypot(x, y))
    error = fit.of_function({"place_x": x / size, "place_y": y / size})
    return FigureValue("rotation_radius_mm", "*", MILLI * size, MILLI * error)


def _coefficients(fit: RotationFit, letters: tuple[str, ...]) -> Texts:
    def stated(estimate: tuple[float, float], factor: float, nominal: float = 0.0) -> str:
        return with_uncertainty(factor * (estimate[0] - nominal), 2.0 * factor * estimate[1])

    out: list[tuple[str, str]] = []
    for a in letters:
        parts = [
            f"bias {stated(fit.of(f'bias_{a}'), MICRO)} µg",
            f"scale {stated(fit.of(f'matrix_{a}{a}'), MICRO, 1.0)} ppm",
        ]
        parts += [f"to {b} {stated(fit.of(f'matrix_{a}{b}'), MILLI)} mg/g" for b in AXES if b != a]
        for effect in fit.effects:
            if f"{effect}_{a}" in fit.names:
                shown = EFFECTS[effect]
                parts.append(f"{effect} {stated(fit.of(f'{effect}_{a}'), shown.factor)} {shown.unit}")
        out.append((f"coefficients of axis {a}", f"{'; '.join(parts)} (k = 2)"))
    places = ", ".join(f"{a} {stated(fit.of(f'place_{a}'), MILLI)} mm" for a in _felt(fit))
    return [*out, ("place of the proof masses in the fixture", f"{places} (k = 2)")]


def _drive(part: RotationPart, rows: pd.DataFrame) -> Texts:
    """Steadiness of the drive's rate, and the uncertainty of the angle by its readings."""
    turning = rows[(rows["sweep"] >= 0) & (rows["axis"] == rows["axis"].iloc[0])]
    departure = turning.groupby("sweep")["rate_deg_s"].agg(lambda r: float((r / r.mean() - 1.0).std())).max()
    angle = np.sqrt((turning[[f"angle_{k}_deg" for k in range(6)]].to_numpy(dtype=float) ** 2).sum(axis=1).max())
    open_urad = MICRO * np.radians(angle)
    text = f"rate steady to {100.0 * departure:.2g} % rms over 10°; the readings determine the angle to {open_urad:.2g} µrad"
    return [("drive", f"{text} (k = 1) or better; every uncertainty includes this")]


def _open(part: RotationPart) -> Texts:
    fastest = max(part.rates_deg_s) / 360.0
    texts = [
        ("not determined", f"the response beyond {fastest:.3g} Hz, the fastest turn; turn faster, or list a sweep")
    ]
    if len(part.planes) < len(AT_REST):
        texts.append(
            (
                "not determined",
                "axes of the table that are not at right angles, apart from misalignment; turn all three planes",
            )
        )
    return texts


def _diagnosis(diagnosis: DiagnosisInG[RotationFit]) -> Texts:
    def size(name: str) -> str:
        fit, shown = diagnosis.extended, EFFECTS[name]
        found = max((fit.of(term) for term in fit.of_effect(name)), key=lambda pair: abs(pair[0]))
        return f"up to {with_uncertainty(shown.factor * found[0], 2.0 * shown.factor * found[1])} {shown.unit} (k = 2)"

    rms = (f"{MICRO * diagnosis.error_g:.3g}", f"{MICRO * diagnosis.extended_g:.3g}", "µg")
    first = ("bias", "scale", "misalignment", "delay", "place")
    unexplained = "the residual; look at it over the angle"
    return diagnosis_texts(diagnosis, "diagnosis", first, size, rms, ("points", "the points"), unexplained)


PROCEDURE = Rotation()
