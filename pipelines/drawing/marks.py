"""The marks of a chart as parts of SVG text: points, lines, bands, bars, cells and labels at their places."""

from collections.abc import Callable
from dataclasses import dataclass
from html import escape

import numpy as np

from inertial.arrays import Array, Flags
from pipelines.drawing.chart import DIVERGING, ROLES, SEQUENTIAL, Anchor, ColourScale, Trace

OUTLINE = "#555555"
INSIDE = 1e-6
BAR_SHARE = 0.7  # of the distance of two bars


@dataclass(frozen=True)
class PlotArea:
    """A rectangle of the picture, in its pixels, and the shares of both axes that values lie at."""

    left: float
    top: float
    width: float
    height: float
    across: Callable[[Array], Array]
    along: Callable[[Array], Array]

    def x(self, values: Array) -> Array:
        """Horizontal places of values, not outside of the rectangle."""
        return self.left + self.width * np.clip(self.across(values), 0.0, 1.0)

    def y(self, values: Array) -> Array:
        """Vertical places of values, not outside of the rectangle."""
        return self.top + self.height * (1.0 - np.clip(self.along(values), 0.0, 1.0))

    def holds(self, x: Array, y: Array) -> Flags:
        """Mask of the points inside the rectangle."""
        across, along = self.across(x), self.along(y)
        return (
            np.isfinite(across + along) & (np.abs(across - 0.5) <= 0.5 + INSIDE) & (np.abs(along - 0.5) <= 0.5 + INSIDE)
        )


def shade(values: Array, scale: ColourScale) -> list[str]:
    """The colours of values on a scale; grey where a value is missing."""
    anchors = DIVERGING if scale.diverging else SEQUENTIAL
    where = np.array([share for share, _ in anchors])
    colours = np.array([[int(text[k : k + 2], 16) for k in (1, 3, 5)] for _, text in anchors], dtype=float)
    share = np.clip((values - scale.low) / ((scale.high - scale.low) or 1.0), 0.0, 1.0)
    channels = [np.interp(np.nan_to_num(share), where, colours[:, k]).round().astype(int) for k in range(3)]
    hex_codes = [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in zip(*channels, strict=True)]
    return [colour if np.isfinite(value) else "#999999" for colour, value in zip(hex_codes, values, strict=True)]


def _points(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    inside = area.holds(trace.x, trace.y)
    x, y = area.x(trace.x[inside]), area.y(trace.y[inside])
    role = ROLES[trace.role]
    parts: list[str] = []
    if trace.error is not None:
        low, high = (area.y((trace.y + sign * trace.error)[inside]) for sign in (-1.0, 1.0))
        bars = "".join(f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(x, low, high, strict=True))
        parts.append(f'<path d="{bars}" stroke="{role}"/>')
    if trace.colour is None or scale is None:
        return "".join(parts) + marks(x, y, trace, role)
    colours = np.array(shade(trace.colour[inside], scale))
    parts.append(marks(x, y, trace, OUTLINE, 1.0))
    for colour in dict.fromkeys(colours.tolist()):
        of_colour = colours == colour
        parts.append(marks(x[of_colour], y[of_colour], trace, colour))
    return "".join(parts)


def marks(x: Array, y: Array, trace: Trace, colour: str, wider: float = 0.0) -> str:
    """All points of one colour as one path: a round end of a line without length is a dot."""
    if not x.size:
        return ""
    size = trace.size + wider
    if trace.symbol == "circle":
        dots = "".join(f"M{a:.1f} {b:.1f}h.01" for a, b in zip(x, y, strict=True))
        return f'<path d="{dots}" stroke="{colour}" stroke-width="{size:g}" stroke-linecap="round"/>'
    half = 0.5 * size
    shape = {
        "triangle-up": (0.0, -half, f"l{half:.1f} {size:.1f}h{-size:.1f}z"),
        "triangle-down": (0.0, half, f"l{half:.1f} {-size:.1f}h{-size:.1f}z"),
        "square": (-half, -half, f"h{size:.1f}v{size:.1f}h{-size:.1f}z"),
        "diamond": (0.0, -half, f"l{half:.1f} {half:.1f}l{-half:.1f} {half:.1f}l{-half:.1f} {-half:.1f}z"),
    }[trace.symbol]
    path = "".join(f"M{a + shape[0]:.1f} {b + shape[1]:.1f}{shape[2]}" for a, b in zip(x, y, strict=True))
    return f'<path d="{path}" fill="{colour}"/>'


def _line(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    x, y = area.x(trace.x), area.y(trace.y)
    drawn = np.isfinite(x + y) & (np.abs(area.across(trace.x) - 0.5) <= 0.5 + INSIDE) & ~_far_outside(area, trace.y)
    path, pen = "", "M"
    for a, b, visible in zip(x, y, drawn, strict=True):
        path += f"{pen}{a:.1f} {b:.1f}" if visible else ""
        pen = "L" if visible else "M"
    dash = ' stroke-dasharray="6 4"' if trace.dashed else ""
    width = trace.width or (1.6 if trace.name else 0.8)
    return f'<path d="{path}" stroke="{ROLES[trace.role]}" stroke-width="{width:g}" fill="none"{dash}/>' if path else ""


def _far_outside(area: PlotArea, y: Array) -> Flags:
    """Mask of the points above or below the rectangle with their neighbours: the line does not follow its edge."""
    outside = np.abs(area.along(y) - 0.5) > 0.5 + INSIDE
    return outside & np.append(outside[1:], True) & np.append(True, outside[:-1])


def _band(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    high = np.asarray(trace.high)
    finite = np.isfinite(trace.x + trace.y + high)
    x = area.x(trace.x[finite])
    edge = [*zip(x, area.y(trace.y[finite]), strict=True), *zip(x[::-1], area.y(high[finite])[::-1], strict=True)]
    path = "L".join(f"{a:.1f} {b:.1f}" for a, b in edge)
    return f'<path d="M{path}z" fill="{ROLES[trace.role]}" fill-opacity=".18"/>' if edge else ""


def _bars(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    finite = np.isfinite(trace.x + trace.y)
    at, value = trace.x[finite], trace.y[finite]
    apart = float(np.min(np.diff(np.sort(at)))) if at.size > 1 else 1.0
    left, right = (area.x(at + sign * 0.5 * BAR_SHARE * apart) for sign in (-1.0, 1.0))
    base, top = area.y(np.zeros_like(value)), area.y(value)
    return f'<path d="{_boxes(left, right, base, top)}" fill="{ROLES[trace.role]}"/>'


def _boxes(left: Array, right: Array, low: Array, high: Array) -> str:
    edges = zip(left, right, low, high, strict=True)
    return "".join(f"M{a:.1f} {z:.1f}V{t:.1f}H{b:.1f}V{z:.1f}z" for a, b, z, t in edges)


def _density(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    """Cells in four shades of grey by the logarithm of their count."""
    counts = np.asarray(trace.counts, dtype=float)
    if not counts.any():
        return ""
    level = np.ceil(4.0 * np.log10(1.0 + counts) / np.log10(1.0 + counts.max())).astype(int)
    wide, tall = (float(np.ptp(v)) / max(v.size - 1, 1) for v in (trace.x, trace.y))
    parts: list[str] = []
    for number, colour in enumerate(("#cdd4db", "#b9c0c7", "#a7afb7", "#8a939c"), start=1):
        rows, columns = np.nonzero(level == number)
        left, right = (area.x(trace.x[columns] + sign * 0.5 * wide) for sign in (-1.0, 1.0))
        low, high = (area.y(trace.y[rows] + sign * 0.5 * tall) for sign in (-1.0, 1.0))
        path = _boxes(left, right, low, high)
        parts.append(f'<path d="{path}" fill="{colour}"/>' if path else "")
    return "".join(parts)


def _labels(trace: Trace, area: PlotArea, scale: ColourScale | None) -> str:
    x, y = area.x(trace.x), area.y(trace.y)
    look = f'font-size="11" fill="{ROLES[trace.role]}"'
    anchors = trace.anchors or ("center",) * len(trace.texts)
    return "".join(
        f'<text x="{a + ANCHORED[anchor][1]:.1f}" y="{b + ANCHORED[anchor][2]:.1f}" text-anchor="{ANCHORED[anchor][0]}" '
        f"{look}>{escape(text, quote=False)}</text>"
        for a, b, text, anchor in zip(x, y, trace.texts, anchors, strict=True)
    )


ANCHORED: dict[Anchor, tuple[str, float, float]] = {
    "center": ("middle", 0.0, 4.0),
    "top right": ("start", 3.0, -3.0),
    "top left": ("end", -3.0, -3.0),
    "top center": ("middle", 0.0, -3.0),
    "bottom center": ("middle", 0.0, 12.0),
}
"""Where a label of 11 px stands beside its point: which end of the text, and the place of its base line, px."""


DRAW: dict[str, Callable[[Trace, PlotArea, ColourScale | None], str]] = {
    "points": _points,
    "line": _line,
    "band": _band,
    "bars": _bars,
    "density": _density,
    "labels": _labels,
}
