"""Shares of the contributions to an uncertainty, as bars."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

from pipelines.report.plots import STYLE, WIDTH_IN, svg

if TYPE_CHECKING:
    from collections.abc import Mapping

SMALLEST = 0.01
COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f", "#a6761d", "#66a61e", "#1b4f72",
)  # fmt: skip
REST = "#d9d9d9"


def shares_plot(shares: Mapping[str, Mapping[str, float]]) -> str:
    """One bar per quantity, divided by the shares of u²; contributions below 1 % everywhere are combined as others.

    Parameters
    ----------
    shares : by title of the quantity, then by contribution; each sums to 1
    """
    every = dict.fromkeys(name for one in shares.values() for name in one)
    names = [name for name in every if max(one.get(name, 0.0) for one in shares.values()) >= SMALLEST]
    names.sort(key=lambda name: -sum(one.get(name, 0.0) for one in shares.values()))
    with mpl.rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(WIDTH_IN, 1.1 + 0.34 * len(shares) + 0.22 * -(-len(names) // 3)), layout="constrained")
        place = figure.subplots()
        left = dict.fromkeys(shares, 0.0)
        for number, name in enumerate(names):
            values = [one.get(name, 0.0) for one in shares.values()]
            colour = COLOURS[number % len(COLOURS)]
            place.barh(list(shares), values, left=list(left.values()), color=colour, label=name, height=0.68)
            left = {title: left[title] + value for title, value in zip(left, values, strict=True)}
        rest = [max(0.0, 1.0 - value) for value in left.values()]
        if max(rest, default=0.0) > 1e-3:
            place.barh(list(shares), rest, left=list(left.values()), color=REST, label="others", height=0.68)
        place.invert_yaxis()
        place.set(xlim=(0.0, 1.0), xlabel="share of u²")
        place.xaxis.set_major_formatter(lambda value, _position: f"{100.0 * value:.0f} %")
        figure.legend(loc="outside lower center", ncols=3, frameon=False)
        return svg(figure)
