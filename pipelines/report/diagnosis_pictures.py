"""Charts of a diagnosis: model and measurement, residuals on the sphere, and against recorded quantities."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inertial.state import State
from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Symbol, Trace, symmetric
from pipelines.drawing.mollweide import project, sphere
from pipelines.report.residuals import DriverValues, LotResiduals, band, direction

Array = NDArray[np.float64]

TURNS: tuple[tuple[int, Symbol, str], ...] = (
    (1, "triangle-up", "heating"),
    (-1, "triangle-down", "cooling"),
    (0, "circle", "first soak"),
)
MOST_POINTS = 600
SYMBOLS: dict[str, Symbol] = {"before": "diamond", "after": "square"}
RESIDUAL = "residual / µg"
CLOSE = 60  # poses from which dots are smaller


def model_chart(left: LotResiduals, state: State, output: Array, floor_ug: float) -> Chart:
    """Output against force, measured against explained deviation, and residuals against a normal distribution."""
    explained = left.before - left.after
    something = bool(np.nanmax(np.abs(explained)) > 0.0)
    plots = [_response(left, state, output)]
    if something:
        plots.append(_departure(left, explained))
    plots.append(_quantiles(left, floor_ug, something=something))
    return Chart("Model and measurement", tuple(plots), len(plots), height=350)


def _guide(end: float) -> Trace:
    ends = np.array([-end, end])
    return Trace("", ends, ends, "line", "muted", legend=False)


def _named(axis: str) -> str:
    return axis if axis == "norm" else f"axis {axis}"


def _response(left: LotResiduals, state: State, output: Array) -> Plot:
    own = output[left.shown]
    if left.axes == ("norm",):
        error = 1e6 * (np.linalg.norm(own, axis=-1) - 1.0)
        points = Trace("corrected output", np.arange(error.size, dtype=float), error, size=4.0, legend=False)
        return Plot(
            f"{left.unit}: corrected output", PlotAxis("dwell"), PlotAxis("norm of the output less 1 g / µg"), (points,)
        )
    traces = [
        Trace(_named(name), state.force[left.shown, :, axis], own[:, axis], role=cast("Role", name), size=4.0)
        for axis, name in enumerate(left.axes)
    ]
    return Plot(
        f"{left.unit}: output",
        PlotAxis("specific force along the axis / g"),
        PlotAxis("output over its scale / g"),
        (_guide(1.0), *traces),
    )


def _departure(left: LotResiduals, explained: Array) -> Plot:
    largest = 1.05 * float(np.nanmax(np.abs(left.before)))
    traces: list[Trace] = []
    for axis, name in enumerate(left.axes):
        x, y = explained[:, axis].ravel(), left.before[:, axis].ravel()
        step = max(1, x.size // MOST_POINTS)
        traces.append(Trace(_named(name), x[::step], y[::step], role=cast("Role", name), size=3.0))
    return Plot(
        "all units: measured and explained",
        PlotAxis("contribution of the added effects / µg"),
        PlotAxis("residual of the judged model / µg"),
        (_guide(largest), *traces),
    )


def _quantiles(left: LotResiduals, floor_ug: float, *, something: bool) -> Plot:
    """Ordered residuals over the noise floor against the normal distribution; the line is pure noise."""
    shown = ((left.before, "before"), (left.after, "after"))[: 2 if something else 1]
    traces = [_guide(3.5)]
    for values, label in shown:
        ordered = np.sort(values[np.isfinite(values)]) / floor_ug
        step = max(1, ordered.size // MOST_POINTS)
        normal = stats.norm.ppf((np.arange(ordered.size) + 0.5) / ordered.size)
        name = label if something else "residuals"
        role, symbol = cast("Role", label), SYMBOLS[label]  # the colours are also those of two axes
        traces.append(
            Trace(name, normal[::step], ordered[::step], role=role, symbol=symbol, size=3.0, legend=something)
        )
    across, along = PlotAxis("quantile of pure noise"), PlotAxis("residual over the floor")
    return Plot("all units: residuals and noise", across, along, tuple(traces))


def pose_chart(left: LotResiduals, state: State) -> Chart:
    """Mean residual of the shown unit at every pose on the whole sphere, before and after, on one scale."""
    rows = [(left.before, ", before"), (left.after, ", after")]
    rows = [(left.before, "")] if left.before is left.after else rows
    poses, place = np.unique(np.round(state.force[left.shown], 2) + 0.0, axis=0, return_inverse=True)
    place = place.reshape(-1)
    x, y = project(poses)
    plots: list[Plot] = []
    first: list[Array] = []
    for values, title in rows:
        for axis, name in enumerate(left.axes):
            own = values[left.shown, axis]
            there = [own[(place == k) & np.isfinite(own)] for k in range(len(poses))]
            means = np.array([float(np.mean(one)) if one.size else 0.0 for one in there])
            first += [means] if values is left.before else []
            texts = tuple(
                f"f = ({p[0]:+.2f}, {p[1]:+.2f}, {p[2]:+.2f}) g: {mean:.3g} µg"
                for p, mean in zip(poses, means, strict=True)
            )
            size = 11.0 if len(poses) < CLOSE else 7.0
            points = Trace("mean residual", x, y, size=size, colour=means, texts=texts, legend=False)
            plots.append(sphere(f"{_named(name)}{title}", (points,)))
    scale = symmetric(np.concatenate(first), "mean residual / µg")
    return Chart(f"Mean residual at every pose, unit {left.unit}", tuple(plots), len(left.axes), scale, height=200)


def driver_chart(left: LotResiduals, drivers: list[DriverValues], temperature: Array | None) -> Chart:
    """Residuals of the shown unit against each driver, axis by axis, before and after, with smooth bands."""
    shown = [(left.before, "before"), (left.after, "after")][: 1 if left.before is left.after else 2]
    plots: list[Plot] = []
    for row, series in enumerate(drivers):
        values = series.values[left.shown]
        turned = None if temperature is None or series.name != "unit_C" else direction(temperature[left.shown])
        low, high = _limits([rows[left.shown] for rows, _ in shown])
        for column, axis in enumerate(left.axes):
            x = values[:, column] if values.ndim > 1 else values
            traces = [_zero(x)]
            for rows, label in shown:
                traces += _against(x, rows[left.shown, column], label, turned, several=len(shown) > 1)
            title = _named(axis) if row == 0 else ""
            plots.append(Plot(title, PlotAxis(series.label), PlotAxis(RESIDUAL, low=low, high=high), tuple(traces)))
    return Chart("Residuals against recorded quantities", tuple(plots), len(left.axes), height=235)


def _limits(values: list[Array]) -> tuple[float, float]:
    largest = max(float(np.nanmax(np.abs(one))) for one in values) or 1.0
    return -1.08 * largest, 1.08 * largest


def _zero(x: Array) -> Trace:
    finite = x[np.isfinite(x)]
    ends = np.array([finite.min(), finite.max()]) if finite.size else np.zeros(2)
    return Trace("", ends, np.zeros(2), "line", "muted", legend=False)


def _against(x: Array, y: Array, label: str, turned: NDArray[np.int64] | None, *, several: bool) -> Iterator[Trace]:
    """Points of one model, by the way the temperature was reached where that is known, and a smooth curve."""
    role = cast("Role", label)
    groups: list[tuple[NDArray[np.bool_], Symbol, str]] = [(np.isfinite(y), "circle", "")]
    if turned is not None:
        groups = [((turned == sign) & np.isfinite(y), mark, name) for sign, mark, name in TURNS]
    for rows, symbol, name in groups:
        words = [label] if several else []
        words += [name] if name else []
        if rows.any():
            yield Trace(
                ", ".join(words) or "residual", x[rows], y[rows], role=role, symbol=symbol, size=4.5, legend=bool(words)
            )
    places, low, high = band(x, y)
    if places.size:
        yield Trace(f"{label}: smooth curve, 95 %", places, low, "band", role, high=high, legend=False)
        yield Trace(f"{label}: smooth curve", places, 0.5 * (low + high), "line", role, legend=False)
