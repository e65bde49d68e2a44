"""Draws the pictures of docs/how-to/choose-poses.md: `python docs/pictures/choose_poses.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("svg")
mpl.rcParams.update(
    {"svg.hashsalt": "tumbleline", "font.size": 10, "axes.spines.top": False, "axes.spines.right": False}
)

import matplotlib.pyplot as plt  # noqa: E402 - the backend comes first

from inertial import frames, poses  # noqa: E402

HERE = Path(__file__).parent
PLANS = {
    "six": "6 faces",
    "twelve": "12 edges",
    "eighteen": "18: faces, edges",
    "twenty_six": "26: and corners",
    "fibonacci24": "24 even",
}
TERMS = ("fx²", "fx·fy", "fx³", "fx·|fx|")
BLUE, ORANGE, GREY = "#0072b2", "#d55e00", "#888888"


def forces(plan: str) -> np.ndarray:
    """Directions of a plan, (n, 3)."""
    angles = np.radians(poses.plan(plan))
    return frames.force_from_angles(angles[:, 0], angles[:, 1])


def terms(force: np.ndarray) -> np.ndarray:
    """Columns of the terms on x, (n, 4)."""
    x, y, _ = force.T
    return np.stack([x**2, x * y, x**3, x * np.abs(x)], axis=1)


def residual(columns: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Residual of columns after a fit of the base model."""
    return columns - base @ np.linalg.lstsq(base, columns, rcond=None)[0]


def base_of(force: np.ndarray) -> np.ndarray:
    """Bias, scale and misalignment of one axis."""
    return np.column_stack([np.ones(len(force)), force])


def draw_plans() -> None:
    """Plans on the sphere, with the remaining fraction of each term after bias, scale and misalignment."""
    figure, rows = plt.subplots(2, len(PLANS), figsize=(12, 4.6), height_ratios=(1.25, 1.0))
    for column, (plan, title) in enumerate(PLANS.items()):
        force = forces(plan)
        sky, bars = rows[0, column], rows[1, column]
        near = force[:, 1] <= 1e-9
        sky.add_patch(plt.Circle((0, 0), 1.0, fill=False, color=GREY, linewidth=0.8))
        sky.scatter(force[~near, 0], force[~near, 2], s=26, facecolors="none", edgecolors=GREY, linewidths=1.0)
        sky.scatter(force[near, 0], force[near, 2], s=30, color=BLUE)
        sky.set(xlim=(-1.15, 1.15), ylim=(-1.15, 1.15), aspect="equal", title=title)
        sky.axis("off")
        columns = terms(force)
        size = np.linalg.norm(columns, axis=0)
        v = np.where(
            size > 1e-9, np.linalg.norm(residual(columns, base_of(force)), axis=0) / np.maximum(size, 1e-9), 0.0
        )
        bars.barh(range(len(TERMS)), np.maximum(v, 0.004), color=[ORANGE if k < 0.01 else BLUE for k in v], height=0.6)
        for place, value in enumerate(v):
            bars.text(
                min(value, 0.8) + 0.04,
                place,
                "not visible" if value < 0.01 else f"{value:.2f}",
                va="center",
                fontsize=9,
            )
        bars.set(
            xlim=(0, 1.15),
            yticks=range(len(TERMS)),
            yticklabels=TERMS if column == 0 else [""] * len(TERMS),
            xticks=(0, 0.5, 1),
        )
        bars.invert_yaxis()
        bars.tick_params(length=0)
    rows[1, 0].set_xlabel("remaining fraction v")
    figure.tight_layout()
    save(figure, "poses-plans")


def draw_rivals() -> None:
    """Difference of a cubic and an odd quadratic after a fit of bias, scale and the wrong effect to 26 poses."""
    force = forces("twenty_six")
    f = np.linspace(-1.0, 1.0, 401)
    wrong = np.column_stack([force[:, 0], force[:, 0] * np.abs(force[:, 0])])
    coefficients = np.linalg.lstsq(wrong, force[:, 0] ** 3, rcond=None)[0]
    curve = 30.0 * (f**3 - np.column_stack([f, f * np.abs(f)]) @ coefficients)
    figure, axes = plt.subplots(figsize=(7.2, 3.2))
    axes.axhline(0.0, color=GREY, linewidth=0.6)
    axes.plot(f, curve, color=BLUE)
    levels = np.unique(np.round(force[:, 0], 6))
    axes.plot(levels, np.interp(levels, f, curve), "o", color=GREY, label="the 26 poses")
    best = np.array([-0.24, 0.24])
    axes.plot(best, np.interp(best, f, curve), "o", color=ORANGE, markersize=9, label="|fx| = 0.24 g")
    axes.set(xlabel="fx / g", ylabel="difference / µg", title="K3 = 30 µg/g³ minus the best fx·|fx|")
    axes.legend(frameon=False)
    figure.tight_layout()
    save(figure, "poses-rivals")


def draw_soaks() -> None:
    """Soaks in one and in both directions: remaining fraction of time after temperature."""
    ways = {"one direction": (0, 20, 40, 60), "both directions": (0, 30, 60, 30, 0)}
    figure, rows = plt.subplots(1, 2, figsize=(8.4, 2.9), sharey=True)
    for axes, (title, stops) in zip(rows, ways.items(), strict=True):
        time = np.arange(len(stops)) * 0.5
        theta = np.array(stops) - 25.0
        rest = residual(time[:, None], np.column_stack([np.ones(len(stops)), theta]))
        v = float(np.linalg.norm(rest) / np.linalg.norm(time))
        axes.step(np.append(time, time[-1] + 0.5), np.append(stops, stops[-1]), where="post", color=BLUE)
        axes.plot(time + 0.42, stops, "o", color=ORANGE)
        axes.set(title=f"{title}: v of ageing {v:.2f}", xlabel="time / h")
    rows[0].set_ylabel("chamber / °C")
    figure.tight_layout()
    save(figure, "poses-soaks")


def save(figure: plt.Figure, name: str) -> None:
    """Writes a picture with the same bytes at every call."""
    figure.savefig(HERE / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    draw_plans()
    draw_rivals()
    draw_soaks()
