"""Single-axis tilt: the output over the angle in one plane, every 15° to 30°."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
import pandas as pd
from pydantic import Field, model_validator
from scipy.stats import norm

from inertial.dynamics.tilt import TiltFit, fit_tilt, left_open
from inertial.errors import NotIdentified
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Trace, level
from pipelines.procedures.base import AtTemperature, RecordByRecord, refuse_broken_turn
from pipelines.procedures.figures import FigureSpec, FigureValue, Texts, UnitOutcome, worst
from pipelines.procedures.recorded import Device, ProcedureStep, Taken, numbers, point_rows
from schemas.bounds import NotNegative, Positive
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.units import axes_among

FEWEST_ANGLES = 6
MICRO, MILLI = 1e6, 1e3
NORMAL = float(norm.ppf(0.975))


class TiltPart(AtTemperature):
    """A whole turn about one axis of the fixture.

    ``about`` is the axis of rotation: with ``x`` the outer axis turns (plane y–z), with ``y`` the inner axis is at 90° first
    (plane x–z). ``angle_uncertainty_deg`` (k = 1) is that of the table: near 0 g it costs 175 µg per 0.01°.
    """

    kind: Literal["tilt"]
    about: Literal["x", "y"] = "x"
    step_deg: Annotated[Positive, Field(le=60.0)] = 15.0
    dwell_s: Annotated[Positive, Field(le=3600.0)] = 10.0
    orders: Literal[1, 3] = 3
    angle_uncertainty_deg: NotNegative = 0.002

    @model_validator(mode="after")
    def _whole_turn(self) -> Self:
        refuse_broken_turn(self.step_deg, FEWEST_ANGLES, "; use 15, 20, 24, 30, 36, 45 or 60")
        return self


class Tilt(RecordByRecord):
    """The output of the axes that lie in one plane, over a whole turn."""

    title = "Single-axis tilt"
    order = 30
    states = "bias, scale, angle of the input axis, K2 and K3 within 1 g, of the axes that lie in the plane"
    source = "IEEE Std 1293, tilt about one axis; reference by gravity, ISO 16063-16"
    part = TiltPart
    figures = (
        FigureSpec(
            "tilt_linearity_ug",
            "µg",
            "largest departure from bias and scale over the plane by K2 and K3 (with orders = 1 the largest residual), worst "
            "axis in it; 1 g only",
        ),
        FigureSpec("tilt_orthogonality_mrad", "mrad", "departure from 90° of the two axes in the plane"),
        FigureSpec("tilt_second_order_ug_g2", "µg/g²", "K2 of the worst axis in the plane"),
    )

    def steps(self, part: TiltPart, recipe: Recipe) -> list[ProcedureStep]:
        """One dwell at each angle, in order of angle."""
        inner = 0.0 if part.about == "x" else 90.0
        turned = [k * part.step_deg for k in range(round(360.0 / part.step_deg))]
        angles = [angle if angle <= 180.0 else angle - 360.0 for angle in turned]
        poses = [Pose(name=f"t{angle:+07.2f}", outer_deg=angle, inner_deg=inner) for angle in angles]
        return [
            ProcedureStep(p.name, p, part.temperature_C, lasting_s=part.dwell_s, setting={"angle_deg": p.outer_deg})
            for p in poses
        ]

    def missing_axes(self, part: TiltPart, letters: Sequence[str]) -> list[str]:
        """Both axes of the plane where the device has neither; else empty."""
        plane = _plane(part)
        return [] if any(axis in letters for axis in plane) else list(plane)

    def points(self, part: TiltPart, taken: Taken, device: Device) -> list[dict[str, Any]]:
        """Mean output of every axis at an angle, which is the encoder's."""
        output = taken.samples.output
        return point_rows(
            unit=taken.unit,
            axis=taken.samples.letters,
            series="output",
            point=taken.number,
            setting=float(taken.reading["outer_deg"]),
            value=output.mean(axis=0),
            uncertainty=output.std(axis=0, ddof=1) / np.sqrt(len(output)),
            time_s=float(taken.samples.time.mean()),
        )

    def of_unit(self, part: TiltPart, unit: str, rows: pd.DataFrame, device: Device) -> UnitOutcome:
        """Figures of the axes in the plane, and their largest residuals."""
        if still := _still(part, rows):
            raise NotIdentified(f"the output of axis {' and '.join(still)} is constant; check the unit")
        fits = {axis: _fit(part, rows[rows["axis"] == axis]) for axis in _turned(part, rows)}
        linear = {axis: _fit(part, rows[rows["axis"] == axis], orders=1) for axis in fits}
        # of the whole model: what K2 and K3 leave in a sine's residual is no wander
        values = [worst([_linearity(axis, fit) for axis, fit in fits.items()]), _orthogonality(part, fits)]
        if part.orders == 3:
            scaled = ((axis, MICRO * np.array(fit.of("second_order")) / fit.scale[0]) for axis, fit in fits.items())
            values.append(
                worst([FigureValue("tilt_second_order_ug_g2", axis, *figure.tolist()) for axis, figure in scaled])
            )
        else:
            values.append(FigureValue.not_determined("tilt_second_order_ug_g2", "*", "orders = 1; set orders = 3"))
        return values, [_residual(axis, fit) for axis, fit in linear.items()]

    def of_lot(self, part: TiltPart, points: pd.DataFrame) -> Texts:
        """The coefficients that a tilt in this plane does not determine."""
        turned = _turned(part, points)
        inside = (
            f"{'axes' if len(turned) > 1 else 'axis'} {' and '.join(turned)}: {'; '.join(left_open(in_plane=True))}"
        )
        about = f"axis {part.about}, about which the unit turns: {'; '.join(left_open(in_plane=False))}"
        return [("not determined by this plane", text) for text in (inside, about)]

    def chart(self, part: TiltPart, points: pd.DataFrame) -> Chart | None:
        """Residual from bias and scale over the angle."""
        if _still(part, points):
            return None
        turn = np.linspace(-np.pi, np.pi, 361)
        traces = [level(np.array([-180.0, 180.0]), 0.0)]
        for axis in _turned(part, points):
            rows = points[points["axis"] == axis]
            linear, model = _fit(part, rows, orders=1), _fit(part, rows)
            residual, error = MICRO * linear.residuals / linear.scale[0], 2.0 * MICRO * model.spread / linear.scale[0]
            name, role = f"axis {axis}, ± 2 σ", cast("Role", axis)
            traces.append(
                Trace(name, np.degrees(linear.angle), residual, role=role, error=np.broadcast_to(error, residual.shape))
            )
            if part.orders == 3:
                curve = MICRO * model.curve(turn) / linear.scale[0]
                traces.append(Trace(f"K2 and K3 of axis {axis}", np.degrees(turn), curve, "line", role))
        axes = PlotAxis("angle / °", step=45.0), PlotAxis("residual from bias and scale / µg")
        return Chart(self.title, (Plot("", *axes, tuple(traces)),))


def _plane(part: TiltPart) -> tuple[str, str]:
    """The axes of the fixture in the plane: f = (Rx(outer)·Rz(inner))ᵀ·(0, 0, 1)."""
    return ("y", "z") if part.about == "x" else ("x", "z")


def _turned(part: TiltPart, rows: pd.DataFrame) -> list[str]:
    """The axes in the plane that have an output."""
    return [axis for axis in axes_among(rows["axis"]) if axis in _plane(part)]


def _still(part: TiltPart, rows: pd.DataFrame) -> list[str]:
    """The axes in the plane whose output is the same at every angle: it has no scale to refer anything to."""
    return [
        axis
        for axis in _turned(part, rows)
        if np.ptp(rows.loc[rows["axis"] == axis, "value"].to_numpy(dtype=float)) == 0.0
    ]


def _fit(part: TiltPart, rows: pd.DataFrame, orders: int | None = None) -> TiltFit:
    """Fit of one axis; the weight holds the share of the table's angle, which is largest near 0 g."""
    angle = np.radians(rows["setting"].to_numpy(dtype=float))
    _, output, white = numbers(rows)
    plain = fit_tilt(angle, output, np.ones_like(output))
    slope = plain.scale[0] * np.abs(np.cos(angle + plain.phase[0]))
    error = np.hypot(white, slope * np.radians(part.angle_uncertainty_deg))
    time = rows["time_s"].to_numpy(dtype=float) if "time_s" in rows else None  # points of earlier versions have none
    return fit_tilt(angle, output, error, orders=part.orders if orders is None else orders, time=time)


def _linearity(axis: str, fit: TiltFit) -> FigureValue:
    """Linearity by K2 and K3 where they are fitted, since the largest of many residuals is mostly noise."""
    if "second_order" in fit.names:
        value, error = (MICRO * part / fit.scale[0] for part in fit.departure)
        low, high = value - NORMAL * error, value + NORMAL * error
        return FigureValue("tilt_linearity_ug", axis, value, error, max(0.0, low), high)
    residual = MICRO * fit.residuals / fit.scale[0]
    k = int(np.argmax(np.abs(residual)))
    spread = float(np.sqrt(np.mean(residual**2)))
    return FigureValue("tilt_linearity_ug", axis, float(abs(residual[k])), spread)


def _residual(axis: str, fit: TiltFit) -> tuple[str, str]:
    residual = MICRO * fit.residuals / fit.scale[0]
    k = int(np.argmax(np.abs(residual)))
    text = f"{residual[k]:+.3g} µg at {np.degrees(fit.angle[k]):.4g}°, rms {np.sqrt(np.mean(residual**2)):.3g} µg"
    return f"largest residual from bias and scale, axis {axis}", text


def _orthogonality(part: TiltPart, fits: dict[str, TiltFit]) -> FigureValue:
    if len(fits) < len(_plane(part)):
        return FigureValue.not_determined(
            "tilt_orthogonality_mrad", "*", "one axis in the plane has an output, two are needed"
        )
    first, second = _plane(part)
    a, b = fits[first].phase, fits[second].phase
    apart = (a[0] - b[0] + np.pi) % (2.0 * np.pi) - np.pi
    departure = MILLI * (abs(apart) - 0.5 * np.pi)
    common = fits[first].phase_covariance(fits[second], float(np.radians(part.angle_uncertainty_deg)))
    error = MILLI * np.sqrt(max(0.0, a[1] ** 2 + b[1] ** 2 - 2.0 * common))
    return FigureValue("tilt_orthogonality_mrad", f"{first}{second}", float(departure), float(error))


PROCEDURE = Tilt()
