"""Pictures of a diagnosis, as SVG that stands inside the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy import stats

from pipelines.report.plots import COLOURS, STYLE, WIDTH_IN, svg
from pipelines.report.residuals import band, direction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from inertial.state import State
    from pipelines.report.residuals import DriverValues, LotResiduals

    Array = NDArray[np.float64]

BEFORE, AFTER = "#d55e00", "#0072b2"
AXIS_COLOURS = {**COLOURS, "norm": "#0072b2"}
MARKS = ((1, "^", "heating"), (-1, "v", "cooling"), (0, "o", "first soak"))
MOST_POINTS = 600


def model_plot(left: LotResiduals, state: State, output: Array, floor_ug: float) -> str:
    """Output against force, measured against explained deviation, and residuals against a normal distribution."""
    explained = left.before - left.after
    something = bool(np.nanmax(np.abs(explained)) > 0.0)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.9), layout="constrained")
        places = figure.subplots(1, 3 if something else 2, squeeze=False)[0]
        _response(places[0], left, state, output)
        if something:
            _departure(places[1], left, explained)
        _quantiles(places[-1], left, floor_ug, something=something)
        return svg(figure)


def _response(place: Axes, left: LotResiduals, state: State, output: Array) -> None:
    for axis, name in enumerate(left.axes):
        if name == "norm":
            place.plot(1e6 * (np.linalg.norm(output[left.shown], axis=-1) - 1.0), ".", color=AFTER, markersize=4)
            place.set(xlabel="dwell", ylabel="norm of the output less 1 g / µg", title=f"{left.unit}: corrected output")
            return
        force = state.force[left.shown, :, axis]
        place.plot(force, output[left.shown, :, axis], ".", color=AXIS_COLOURS[name], markersize=4, label=name)
    place.plot([-1.0, 1.0], [-1.0, 1.0], color="#999999", linewidth=1.0, zorder=1)
    place.set(
        xlabel="specific force along the axis / g", ylabel="output over its scale / g", title=f"{left.unit}: output"
    )
    place.legend(frameon=False, handletextpad=0.1)


def _departure(place: Axes, left: LotResiduals, explained: Array) -> None:
    largest = 1.05 * float(np.nanmax(np.abs(left.before)))
    place.plot([-largest, largest], [-largest, largest], color="#999999", linewidth=1.0, zorder=1)
    for axis, name in enumerate(left.axes):
        x, y = explained[:, axis].ravel(), left.before[:, axis].ravel()
        step = max(1, x.size // MOST_POINTS)
        place.plot(x[::step], y[::step], ".", color=AXIS_COLOURS[name], markersize=3, alpha=0.6, label=name)
    place.set(
        xlabel="contribution of the added effects / µg",
        ylabel="residual of the judged model / µg",
        title="all units: measured and explained",
    )
    place.legend(frameon=False, handletextpad=0.1, markerscale=2.0)


def _quantiles(place: Axes, left: LotResiduals, floor_ug: float, *, something: bool) -> None:
    """Ordered residuals over the noise floor against the normal distribution; the line is pure noise."""
    place.plot([-3.5, 3.5], [-3.5, 3.5], color="#999999", linewidth=1.0, zorder=1)
    shown = ((left.before, BEFORE, "before"), (left.after, AFTER, "after"))[: 2 if something else 1]
    for values, colour, label in shown:
        ordered = np.sort(values[np.isfinite(values)]) / floor_ug
        step = max(1, ordered.size // MOST_POINTS)
        normal = stats.norm.ppf((np.arange(ordered.size) + 0.5) / ordered.size)
        place.plot(normal[::step], ordered[::step], ".", color=colour, markersize=3, label=label)
    place.set(xlabel="quantile of pure noise", ylabel="residual over the floor", title="all units: residuals and noise")
    if something:
        place.legend(frameon=False, handletextpad=0.1, markerscale=2.5)


def pose_maps(left: LotResiduals, state: State) -> str:
    """Mean residual of the shown unit at every pose on the whole sphere, before and after, on one scale."""
    rows = [(left.before, ", before"), (left.after, ", after")]
    rows = [(left.before, "")] if left.before is left.after else rows
    poses, means = _by_pose(state.force[left.shown], [values[left.shown] for values, _ in rows])
    largest = float(np.max(np.abs(means[0]))) or 1.0
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH_IN, 0.6 + 2.35 * len(rows)), layout="constrained")
        grid = figure.subplots(len(rows), len(left.axes), squeeze=False, subplot_kw={"projection": "mollweide"})
        for row, (_, title) in enumerate(rows):
            for column, axis in enumerate(left.axes):
                _map(grid[row, column], poses, means[row][column], largest)
                grid[row, column].set_title(f"{axis if axis == 'norm' else f'axis {axis}'}{title}", pad=16)
        colours = ScalarMappable(Normalize(-largest, largest), "RdBu_r")
        bar = figure.colorbar(colours, ax=grid, shrink=0.75, aspect=26, pad=0.015)
        bar.set_label("mean residual / µg")
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
        return svg(figure)


def _by_pose(force: Array, values: list[Array]) -> tuple[Array, list[list[Array]]]:
    """Directions (p, 3), and for each of the values (axes, n) its mean at every pose, axis by axis."""
    poses, place = np.unique(np.round(force, 2) + 0.0, axis=0, return_inverse=True)
    place = place.reshape(-1)
    means = [
        [
            np.array(
                [np.nanmean(v[place == k]) if np.isfinite(v[place == k]).any() else 0.0 for k in range(len(poses))]
            )
            for v in both
        ]
        for both in values
    ]
    return poses, means


def _map(place: Axes, poses: Array, means: Array, largest: float) -> None:
    longitude, latitude = np.arctan2(poses[:, 1], poses[:, 0]), np.arcsin(np.clip(poses[:, 2], -1.0, 1.0))
    for mark in np.radians([-90.0, 0.0, 90.0]):
        place.plot(
            np.full(40, mark), np.radians(np.linspace(-90.0, 90.0, 40)), color="#dddddd", linewidth=0.7, zorder=1
        )
    place.plot(np.radians(np.linspace(-180.0, 180.0, 60)), np.zeros(60), color="#dddddd", linewidth=0.7, zorder=1)
    place.scatter(
        longitude, latitude, c=means, s=95 if len(poses) < 60 else 30, cmap="RdBu_r", vmin=-largest, vmax=largest,
        edgecolors="#888888", linewidths=0.5, zorder=3,
    )  # fmt: skip
    for name, (x, y) in {"+x": (0.0, 0.0), "+y": (0.5 * np.pi, 0.0), "−y": (-0.5 * np.pi, 0.0)}.items():
        place.annotate(
            name, (x, y), xytext=(9, 6), textcoords="offset points", fontsize=8, color="#666666", ha="center",
            va="center", zorder=2,
        )  # fmt: skip
    for name, y in (("+z", 1.0), ("−z", 0.0)):
        place.annotate(
            name, (0.5, y), xycoords="axes fraction", xytext=(0, 6 if y else -7), textcoords="offset points", fontsize=8,
            color="#666666", ha="center", va="center",
        )  # fmt: skip
    place.set_xticks([])
    place.set_yticks([])


def driver_plots(left: LotResiduals, drivers: list[DriverValues], temperature: Array | None) -> str:
    """Residuals of the shown unit against each driver, axis by axis, before and after, with smooth bands."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 2.45 * len(drivers) + 0.3), layout="constrained")
        grid = figure.subplots(len(drivers), len(left.axes), sharey="row", squeeze=False)
        for row, series in enumerate(drivers):
            for column, axis in enumerate(left.axes):
                place = grid[row, column]
                values = series.values[left.shown]
                x = values[:, column] if values.ndim > 1 else values
                warm = temperature[left.shown] if temperature is not None and series.name == "unit_C" else None
                _against(place, x, left, column, warm)
                place.set_xlabel(series.label)
                place.xaxis.set_major_locator(MaxNLocator(6))
                if row == 0:
                    place.set_title(axis if axis == "norm" else f"axis {axis}")
            grid[row, 0].set_ylabel("residual / µg")
        turned = temperature is not None and any(series.name == "unit_C" for series in drivers)
        if turned or left.before is not left.after:
            _legend(figure, grid[0, -1], colours=left.before is not left.after, marks=turned)
        return svg(figure)


def _against(place: Axes, x: Array, left: LotResiduals, column: int, temperature: Array | None) -> None:
    place.axhline(0.0, color="#999999", linewidth=1.0)
    shown = [(left.before, BEFORE), (left.after, AFTER)][: 1 if left.before is left.after else 2]
    for values, colour in shown:
        y = values[left.shown, column]
        if temperature is None:
            place.plot(x, y, ".", color=colour, markersize=4, alpha=0.55)
        else:
            turned = direction(temperature)
            for sign, mark, _ in MARKS:
                own = turned == sign
                place.plot(x[own], y[own], mark, color=colour, markersize=4, alpha=0.55, markeredgewidth=0)
        places, low, high = band(x, y)
        if places.size:
            place.fill_between(places, low, high, color=colour, alpha=0.25, linewidth=0)
            place.plot(places, 0.5 * (low + high), color=colour, linewidth=1.4)


def _legend(figure: Figure, place: Axes, *, colours: bool, marks: bool) -> None:
    shown = [(".", BEFORE, "before", 8), (".", AFTER, "after", 8)] if colours else []
    shown += [(mark, "#777777", name, 5) for _, mark, name in MARKS[:2]] if marks else []
    handles = [place.plot([], [], mark, color=c, label=name, markersize=size)[0] for mark, c, name, size in shown]
    figure.legend(handles=handles, loc="outside upper right", ncols=4, frameon=False, handletextpad=0.1)
