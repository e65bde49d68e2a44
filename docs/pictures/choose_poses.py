"""Draws the pictures of docs/how-to/choose-poses.md: `python docs/pictures/choose_poses.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inertial import frames, poses
from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import level
from pipelines.drawing.mollweide import project, sphere
from pipelines.drawing.picture import picture

HERE = Path(__file__).parent
PLANS = {
    "six": "6 faces",
    "twelve": "12 edges",
    "eighteen": "18: faces, edges",
    "twenty_six": "26: and corners",
    "fibonacci24": "24 even",
}
TERMS = ("fx²", "fx·fy", "fx³", "fx·|fx|")
LEAST = 0.01  # smaller remaining fractions are not visible


def forces(plan: str) -> NDArray[np.float64]:
    """Directions of a plan, (n, 3)."""
    angles = np.radians(poses.plan(plan))
    return frames.force_from_angles(angles[:, 0], angles[:, 1])


def terms(force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Columns of the terms on x, (n, 4)."""
    x, y, _ = force.T
    return np.stack([x**2, x * y, x**3, x * np.abs(x)], axis=1)


def residual(columns: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residual of columns after a fit of the base model."""
    return columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]


def base_of(force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bias, scale and misalignment of one axis."""
    return np.column_stack([np.ones(len(force)), force])


def draw_plans() -> Chart:
    """Plans on the sphere, with the remaining fraction of each term after bias, scale and misalignment."""
    maps: list[Plot] = []
    bars: list[Plot] = []
    place = np.arange(len(TERMS), dtype=float)[::-1]
    for plan, title in PLANS.items():
        force = forces(plan)
        maps.append(sphere(title, (Trace("pose", *project(force), size=8.0, legend=False),)))
        columns = terms(force)
        size = np.linalg.norm(columns, axis=0)
        left = np.linalg.norm(residual(columns, base_of(force)), axis=0)
        v = np.where(size > 1e-9, left / np.maximum(size, 1e-9), 0.0)
        lines = np.stack([np.zeros(v.size), v, np.full(v.size, np.nan)], axis=1).ravel()
        seen = v >= LEAST
        texts = tuple(f"{value:.2f}" for value in v[seen])
        unseen = ("not visible",) * int(np.count_nonzero(~seen))
        traces = (
            Trace("remaining fraction", lines, np.repeat(place, 3), "line", width=14.0, legend=False),
            Trace("v", v[seen] + 0.14, place[seen] - 0.02, "labels", "ink", texts=texts, legend=False),
            Trace("", np.full(len(unseen), 0.45), place[~seen], "labels", "before", texts=unseen, legend=False),
        )
        across = PlotAxis("remaining fraction v", low=0.0, high=1.35, step=0.5)
        bars.append(Plot("", across, PlotAxis("", names=TERMS[::-1], low=-0.6, high=len(TERMS) - 0.4), traces))
    return Chart("Plans of poses and what they leave of four terms", (*maps, *bars), len(PLANS), height=185)


def draw_rivals() -> Chart:
    """Difference of a cubic and an odd quadratic after a fit of bias, scale and the wrong effect to 26 poses."""
    force = forces("twenty_six")
    f = np.linspace(-1.0, 1.0, 401)
    wrong = np.column_stack([force[:, 0], force[:, 0] * np.abs(force[:, 0])])
    coefficients = np.linalg.lstsq(wrong, force[:, 0] ** 3, rcond=None)[0]
    curve = 30.0 * (f**3 - np.column_stack([f, f * np.abs(f)]) @ coefficients)
    levels = np.unique(np.round(force[:, 0], 6))
    best = np.array([-0.24, 0.24])
    traces = (
        level(f, 0.0, dashed=False),
        Trace("difference", f, curve, "line"),
        Trace("the 26 poses", levels, np.interp(levels, f, curve), role="muted", size=9.0),
        Trace("|fx| = 0.24 g", best, np.interp(best, f, curve), role="before", size=11.0),
    )
    title = "K3 = 30 µg/g³ minus the best fx·|fx|"
    return Chart(title, (Plot(title, PlotAxis("fx / g"), PlotAxis("difference / µg"), traces),), height=340)


def draw_soaks() -> Chart:
    """Soaks in one and in both directions: remaining fraction of time after temperature."""
    plots: list[Plot] = []
    for title, stops in {"one direction": (0, 20, 40, 60), "both directions": (0, 30, 60, 30, 0)}.items():
        time, chamber = np.arange(len(stops)) * 0.5, np.array(stops, dtype=float)
        rest = residual(time[:, None], np.column_stack([np.ones(len(stops)), chamber - 25.0]))
        v = float(np.linalg.norm(rest) / np.linalg.norm(time))
        edges = np.append(np.repeat(time, 2)[1:], time[-1] + 0.5)
        traces = (
            Trace("chamber", edges, np.repeat(chamber, 2), "line"),
            Trace("measurement", time + 0.42, chamber, role="before", size=9.0),
        )
        plots.append(
            Plot(f"{title}: v of ageing {v:.2f}", PlotAxis("time / h"), PlotAxis("chamber / °C", step=20.0), traces)
        )
    return Chart("Soaks in one direction and in both directions", tuple(plots), 2, height=280)


if __name__ == "__main__":
    for name, draw in {"plans": draw_plans, "rivals": draw_rivals, "soaks": draw_soaks}.items():
        (HERE / f"poses-{name}.svg").write_bytes(picture(draw(), ".svg"))
