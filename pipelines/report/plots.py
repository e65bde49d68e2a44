"""Plots of one unit, as SVG that stands inside the page."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, FuncFormatter, MaxNLocator, NullLocator

from schemas.units import AXES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

COLOURS = {"x": "#0072b2", "y": "#d55e00", "z": "#009e73"}  # for any colour vision (Okabe and Ito)
WIDTH_IN = 11.5
STYLE: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "axes.axisbelow": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "tumbleline",
    "font.family": "sans-serif",
    "text.parse_math": False,  # names of columns and units are shown literally, with dollar signs
    "axes.titley": 1.0,  # a fixed place: looking for a free one costs as much as drawing the points
}
MOST_TICKS = (
    5  # every tick is five drawn objects; with the default number of ticks they take half of the time of a report
)


def model_plots(dwells: pd.DataFrame, residuals: pd.DataFrame) -> str:
    """Measurement and model against force, and the residuals against force and temperature, axis by axis."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 7.6))
        grid = figure.subplots(3, 3, sharey="row", squeeze=False)
        _few_ticks(*grid.ravel())
        figure.subplots_adjust(left=0.075, right=0.995, bottom=0.065, top=0.96, wspace=0.06, hspace=0.32)
        soaks = _soak_colours(dwells)
        for column, axis in enumerate(AXES):
            own = residuals[residuals["axis"] == axis].merge(dwells[["dwell", "soak", f"out_{axis}"]], on="dwell")
            colours = [soaks[soak] for soak in own["soak"]]
            unit = str(dwells["out_unit"].iloc[0])
            _response(grid[0, column], own, axis, unit, colours)
            _scatter(grid[1, column], own["force_g"].to_numpy(), own["residual_ug"].to_numpy(), colours)
            grid[1, column].set(xlabel=f"specific force on {axis} / g", ylabel="residual / µg" if column == 0 else "")
            _scatter(grid[2, column], own["unit_C"].to_numpy(), own["residual_ug"].to_numpy(), colours)
            grid[2, column].set(xlabel="temperature of the unit / °C", ylabel="residual / µg" if column == 0 else "")
        largest = 1.08 * float(residuals["residual_ug"].abs().max())
        for row in (1, 2):
            grid[row, 0].set_ylim(-largest, largest)
        return svg(figure)


def check_plots(residuals: pd.DataFrame, verification: pd.DataFrame, allan: pd.DataFrame) -> str:
    """Residuals by pose, the error on poses not used, and the Allan deviation."""
    shown = 1 + (len(verification) > 0) + (len(allan) > 0)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN * shown / 3.0, 3.5))
        places = list(figure.subplots(1, shown, squeeze=False)[0])
        _few_ticks(*places)
        edge = 0.075 * 3.0 / shown
        figure.subplots_adjust(left=edge, right=1.0 - 0.01, bottom=0.14, top=0.91, wspace=0.3)
        _by_pose(places.pop(0), residuals)
        if len(verification):
            _verification(places.pop(0), verification)
        if len(allan):
            _allan(places.pop(0), allan)
        return svg(figure)


def lot_plot(verification: pd.DataFrame, poses: pd.DataFrame, units: list[str], limit_ug: float) -> str:
    """Error on the poses not used, unit by unit: single dwells in grey, the means of the poses against the limit."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 2.9))
        place = figure.subplots()
        _few_ticks(place)
        figure.subplots_adjust(left=0.075, right=0.995, bottom=0.11, top=0.97)
        for position, unit in enumerate(units):
            names = poses.loc[poses["unit"] == unit, "pose"].tolist()
            spread = dict(zip(names, np.linspace(-0.25, 0.25, len(names)) if len(names) > 1 else [0.0], strict=True))
            single = verification[verification["unit"] == unit]
            place.scatter(position + single["pose"].map(spread), single["error_ug"], s=9, c="#b4b4b4", linewidths=0)
            means = poses.loc[poses["unit"] == unit, "error_ug"].to_numpy()
            colour = np.where(np.abs(means) > limit_ug, "#c62828", "#1565c0")
            place.scatter(position + np.array([*spread.values()]), means, s=30, c=colour, linewidths=0)
        _limit_lines(place, limit_ug)
        place.set_xticks(range(len(units)), units)
        place.set(ylabel="|a| − g / µg", xlim=(-0.6, len(units) - 0.4))
        place.grid(visible=False, axis="x")
        return svg(figure)


def _few_ticks(*places: Axes) -> None:
    for place in places:
        for axis in (place.xaxis, place.yaxis):
            axis.set_major_locator(MaxNLocator(MOST_TICKS, steps=[1, 2, 2.5, 5, 10]))


def _response(place: Axes, own: pd.DataFrame, axis: str, unit: str, colours: list[tuple[float, ...]]) -> None:
    force, output = own["force_g"].to_numpy(), own[f"out_{axis}"].to_numpy()
    line = np.polynomial.Polynomial.fit(force, output, 1)
    ends = np.array([force.min(), force.max()])
    place.plot(ends, line(ends), color="#999999", linewidth=1.0, zorder=1)
    place.scatter(force, output, s=14, c=colours, linewidths=0, zorder=2)
    place.yaxis.set_major_formatter(EngFormatter())
    place.set(
        title=f"axis {axis}", xlabel=f"specific force on {axis} / g", ylabel=f"output / {unit}" if axis == "x" else ""
    )


def _scatter(place: Axes, x: NDArray[np.float64], y: NDArray[np.float64], colours: list[tuple[float, ...]]) -> None:
    place.axhline(0.0, color="#999999", linewidth=1.0)
    place.scatter(x, y, s=14, c=colours, linewidths=0)


def _soak_colours(dwells: pd.DataFrame) -> dict[int, tuple[float, ...]]:
    """A colour per soak, from blue (coldest) to red (warmest)."""
    means = dwells.groupby("soak")["unit_C"].mean()
    low, high = means.min(), means.max()
    share = (means - low) / (high - low) if high > low else means * 0.0 + 0.5
    cold, warm = np.array((0.08, 0.33, 0.80)), np.array((0.85, 0.12, 0.10))
    return {int(soak): tuple(cold + (warm - cold) * value) for soak, value in share.items()}  # pyright: ignore[reportArgumentType]


def _by_pose(place: Axes, residuals: pd.DataFrame) -> None:
    poses = list(dict.fromkeys(residuals.sort_values("dwell")["pose"]))
    where = {pose: number + 1 for number, pose in enumerate(poses)}
    place.axhline(0.0, color="#999999", linewidth=1.0)
    for shift, axis in zip((-0.2, 0.0, 0.2), AXES, strict=True):
        own = residuals[residuals["axis"] == axis]
        numbers = own["pose"].map(where).to_numpy(dtype=float)
        place.scatter(numbers + shift, own["residual_ug"], s=12, c=COLOURS[axis], label=axis, linewidths=0)
    place.set(title="residuals by pose", xlabel="pose", ylabel="residual / µg")
    place.legend(loc="upper right", ncols=3, frameon=False, handletextpad=0.1, columnspacing=0.8)
    low, high = place.get_ylim()
    place.set_ylim(low, high + 0.18 * (high - low))


def _verification(place: Axes, rows: pd.DataFrame) -> None:
    """Single dwells against the error expected of noise and wander; limits apply to the means of their poses."""
    numbers = np.arange(len(rows)) + 1
    expanded = 2.0 * rows["uncertainty_ug"].to_numpy()
    place.fill_between(numbers, -expanded, expanded, color="#d9d9d9", linewidth=0, label="expected, k = 2")
    place.scatter(numbers, rows["error_ug"], s=22, c="#1565c0", linewidths=0, label="|a| − g")
    place.set(title="poses not used by the fit", xlabel="verification dwell", ylabel="|a| − g / µg")
    place.legend(loc="upper right", ncols=2, frameon=False, handletextpad=0.4, columnspacing=0.8)
    low, high = place.get_ylim()
    place.set_ylim(low, high + 0.2 * (high - low))


def _limit_lines(place: Axes, limit_ug: float) -> None:
    if np.isfinite(limit_ug):
        for limit in (-limit_ug, limit_ug):
            place.axhline(limit, color="#c62828", linewidth=1.0, linestyle="--")


def _allan(place: Axes, allan: pd.DataFrame) -> None:
    for axis in AXES:
        own = allan[allan["axis"] == axis].sort_values("tau_s")
        place.fill_between(own["tau_s"], own["low_ug"], own["high_ug"], color=COLOURS[axis], alpha=0.18, linewidth=0)
        place.plot(own["tau_s"], own["deviation_ug"], "o", color=COLOURS[axis], markersize=3.5, label=axis)
        place.plot(own["tau_s"], own["fitted_ug"], "-", color=COLOURS[axis], linewidth=1.2)
    place.set(xscale="log", yscale="log", title="Allan deviation", xlabel="averaging time / s", ylabel="σ / µg")
    for scale in (place.xaxis, place.yaxis):  # minor ticks and typeset powers cost more than the curves themselves
        scale.set_minor_locator(NullLocator())
        scale.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    _slope_guides(place, allan)
    place.legend(loc="upper right", ncols=3, frameon=False, handletextpad=0.1, columnspacing=0.8)


def _slope_guides(place: Axes, allan: pd.DataFrame) -> None:
    """Thin lines of slope −½ and +½ through the middle of the curve's minimum, as guides."""
    tau = np.array([allan["tau_s"].min(), allan["tau_s"].max()])
    low, high = allan["low_ug"].min() / 2.0, allan["high_ug"].max() * 2.2
    first = allan.loc[allan["tau_s"] == tau[0], "deviation_ug"].mean()
    place.plot(tau, first * np.sqrt(tau[0] / tau), ":", color="#777777", linewidth=1.0, label="_slope −½")
    last = allan.loc[allan["tau_s"] == tau[1], "deviation_ug"].mean()
    place.plot(tau, last * np.sqrt(tau / tau[1]), ":", color="#777777", linewidth=1.0, label="_slope +½")
    place.set_ylim(low, high)
    first_tick = 10.0 ** np.floor(np.log10(low))
    ticks = first_tick * np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0])
    place.set_yticks(ticks[(ticks >= low) & (ticks <= high)])


def svg(figure: Figure) -> str:
    """A figure as SVG text that stands inside a page."""
    sink = io.StringIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # the browser has fonts of its own
        figure.savefig(sink, format="svg", metadata={"Date": None, "Creator": None})
    text = sink.getvalue()
    return text[text.index("<svg") :]
