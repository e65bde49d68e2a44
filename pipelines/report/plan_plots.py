"""Pictures of a plan, as SVG that stands inside the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from inertial.frames import force_from_angles
from inertial.planning.visibility import confounding
from pipelines.report.plots import COLOURS, STYLE, WIDTH_IN, svg
from pipelines.schedule.timing import temperatures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from pipelines.planning.plan import PlanContext
    from pipelines.schedule.timing import Activity

    Array = NDArray[np.float64]

FIT, CHECK, WAY = "#0072b2", "#d55e00", "#9aa7b5"
VIEWS = ((25.0, 20.0, "seen from +x, above"), (25.0, 200.0, "seen from −x, above"), (-90.0, 0.0, "seen from −z"))


def sphere_plot(context: PlanContext) -> str:
    """Directions of specific force in the fixture for every pose, from three sides, with the path of the first soak."""
    fit, check = (_directions(context.activities, kind) for kind in ("dwell", "verification"))
    first = [s for s in context.activities if s.kind == "dwell" and s.step.soak == context.activities[0].step.soak]
    way = _directions(first, "dwell")
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH_IN, 4.0), layout="constrained")
        places = figure.subplots(1, len(VIEWS))
        for place, (elevation, azimuth, title) in zip(places, VIEWS, strict=True):
            _sphere(place, _view(elevation, azimuth))
            _dots(place, way, fit, check, _view(elevation, azimuth))
            place.set_title(title)
        handles = [places[0].plot([], [], "o", color=FIT, label="fit", markersize=7)[0]]
        if len(check):
            handles += places[0].plot([], [], "s", color=CHECK, label="verification", markersize=6)
        handles += places[0].plot([], [], "-", color=WAY, label="order in the first soak", linewidth=1.2)
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
        return svg(figure)


def _directions(activities: list[Activity], kind: str) -> Array:
    """Directions (n, 3) of specific force in the fixture."""
    angles = [(s.step.pose.outer_deg, s.step.pose.inner_deg) for s in activities if s.kind == kind]
    if not angles:
        return np.zeros((0, 3))
    outer, inner = np.radians(np.array(angles)).T
    return force_from_angles(outer, inner)


def _view(elevation: float, azimuth: float) -> Array:
    """Rotation (3, 3): rows are to the right, up and towards the eye."""
    e, a = np.radians(elevation), np.radians(azimuth)
    eye = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    return np.stack([right, np.cross(eye, right), eye])


def _sphere(place: Axes, view: Array) -> None:
    """Outline, the three coordinate circles, and the axes' letters."""
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    place.plot(np.cos(turn), np.sin(turn), color="#bbbbbb", linewidth=1.0)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    for k in range(3):
        seen = view @ np.roll(circle, k, axis=0)
        for part, style in ((seen[2] >= 0.0, "-"), (seen[2] < 0.0, ":")):
            place.plot(
                np.where(part, seen[0], np.nan), np.where(part, seen[1], np.nan), style, color="#d4d4d4", linewidth=0.8
            )
    for axis, letter in enumerate("xyz"):
        for sign, name in ((1.0, f"+{letter}"), (-1.0, f"−{letter}")):
            x, y, depth = sign * view[:, axis]
            if depth > -0.2:
                place.annotate(name, (1.12 * x, 1.12 * y), color=COLOURS[letter], ha="center", va="center", fontsize=10)
    place.set(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25), aspect="equal")
    place.set_axis_off()


def _dots(place: Axes, way: Array, fit: Array, check: Array, view: Array) -> None:
    """The path from pose to pose, the poses on the near side full and those on the far side faint; repeats are larger."""
    path = way @ view.T
    place.plot(path[:, 0], path[:, 1], color=WAY, linewidth=0.8, alpha=0.55, zorder=2)
    for directions, colour, mark, size in ((fit, FIT, "o", 30.0), (check, CHECK, "s", 34.0)):
        poses, count = np.unique(np.round(directions, 4), axis=0, return_counts=True)
        if not len(poses):
            continue
        seen = poses @ view.T
        near = seen[:, 2] >= -1e-9
        large = size * np.sqrt(count / count.min())
        place.scatter(seen[near, 0], seen[near, 1], s=large[near], c=colour, marker=mark, linewidths=0, zorder=4)
        place.scatter(
            seen[~near, 0],
            seen[~near, 1],
            s=0.6 * large[~near],
            c=colour,
            marker=mark,
            alpha=0.22,
            linewidths=0,
            zorder=1,
        )


def temperature_plot(context: PlanContext) -> str:
    """Chamber and slowest device over the station's time, with the times of the measurements."""
    time, air, device = np.array(temperatures(context.activities, context.station)).T / np.array([[60.0], [1.0], [1.0]])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 3.3), layout="constrained")
        place = figure.subplots()
        place.plot(time, air, color="#999999", linewidth=1.0, label="chamber")
        place.plot(time, device, color="#333333", linewidth=1.4, label="slowest device")
        for kind, colour, label in (
            ("dwell", FIT, "dwells"),
            ("verification", CHECK, "verification"),
            ("allan", "#009e73", "static record"),
        ):
            for k, (begin, end) in enumerate(_spans(context.activities, kind)):
                place.axvspan(begin, end, ymax=0.06, color=colour, linewidth=0, label="" if k else label)
        place.set(xlabel="station time / min", ylabel="temperature / °C", xlim=(0.0, float(time[-1])))
        low, high = place.get_ylim()
        place.set_ylim(low - 0.12 * (high - low), high)
        place.legend(loc="upper center", bbox_to_anchor=(0.5, 1.16), ncols=5, frameon=False)
        return svg(figure)


def _spans(activities: list[Activity], kind: str) -> list[tuple[float, float]]:
    """From the first to the last record of a kind at every soak, min."""
    soaks: dict[int, list[Activity]] = {}
    for stretch in activities:
        if stretch.kind == kind:
            soaks.setdefault(stretch.step.soak, []).append(stretch)
    return [(own[0].start / 60.0, (own[-1].start + own[-1].seconds) / 60.0) for own in soaks.values()]


def alias_plot(context: PlanContext) -> str:
    """Heat map of confounding: cosine of the row's effect with the span of the column's, after the model."""
    names, cosines = confounding(context.state, context.recipe.effects)
    if not names:
        return ""
    order = _grouped(cosines)
    names, cosines = [names[k] for k in order], cosines[np.ix_(order, order)]
    size = len(names)
    with mpl.rc_context({**STYLE, "axes.grid": False, "font.size": 9.0}):
        figure = Figure(
            figsize=(WIDTH_IN, 2.4 + 0.27 * size), layout="constrained", dpi=160
        )  # of the squares; the rest is lines
        place = figure.subplots()
        picture = place.pcolormesh(
            cosines, cmap="Blues", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=0.6, rasterized=True
        )
        for row, column in np.argwhere(cosines > 0.98):
            if row != column:
                place.annotate(
                    "=" if cosines[row, column] > 1.0 - 1e-9 else "≈",
                    (column + 0.5, row + 0.5),
                    color="white",
                    ha="center",
                    va="center",
                    fontsize=9,
                )
        ticks = np.arange(size) + 0.5
        place.set_xticks(ticks, names, rotation=90)
        place.set_yticks(ticks, names)
        place.tick_params(length=0)
        place.invert_yaxis()
        place.set_aspect("equal")
        for spine in place.spines.values():
            spine.set_visible(False)
        bar = figure.colorbar(picture, ax=place, shrink=0.6, aspect=30, pad=0.01)
        bar.set_label("cosine of the row's effect with the column's")
        bar.outline.set_visible(False)  # pyright: ignore[reportCallIssue]
        return svg(figure)


def _grouped(cosines: Array) -> list[int]:
    """Order of rows in which each follows the one it is most confounded with."""
    like = np.maximum(cosines, cosines.T)
    left = set(range(len(like)))
    order = [0]
    left.discard(0)
    while left:
        best = max(left, key=lambda k: float(like[order[-1], k]))
        order.append(best)
        left.discard(best)
    return order


def sight_plot(effects: list[dict[str, Any]]) -> str:
    """Remaining fraction v of every effect by axis, as bars."""
    shown = sorted(effects, key=lambda row: row["left"])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.0 + 0.24 * len(shown)), layout="constrained")
        place = figure.subplots()
        height = 0.26
        for k, letter in enumerate("xyz"):
            values = [row["left_by_axis"][k] for row in shown]
            place.barh(np.arange(len(shown)) + (1 - k) * height, values, height, color=COLOURS[letter], label=letter)
        place.set_yticks(np.arange(len(shown)), [row["effect"] for row in shown])
        place.set(
            xlim=(0.0, 1.0),
            ylim=(-0.6, len(shown) - 0.4),
            xlabel="v, fraction of the effect that remains after the model",
        )
        place.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        place.grid(visible=False, axis="y")
        place.legend(loc="lower right", ncols=3, frameon=False, title="sensor axis")
        return svg(figure)
