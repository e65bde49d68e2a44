"""Line charts in a terminal, drawn with braille dots (2 × 4 dots in each character), and points as marks."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.text import Text

DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
BLANK = 0x2800
MARGIN = 9  # characters for the labels on the left


@dataclass(frozen=True)
class Line:
    """One line: name, colour and points (time in s or another quantity, value); a value that is not finite makes a gap.

    mark : character of each point, which are then not joined; empty for a line
    """

    name: str
    style: str
    points: Sequence[tuple[float, float]]
    mark: str = ""


def chart(
    title: str,
    lines: Sequence[Line],
    width: int,
    height: int,
    span: tuple[float, float],
    *,
    bounds: tuple[float, float] | None = None,
    label: Callable[[float], str] | None = None,
) -> "Text":
    """The chart as text of ``height`` rows and about ``width`` columns, with values on the left and times below.

    span : first and last time of the chart, s
    bounds : of the values; those that hold all where None · label : of a time; hours, minutes and seconds where None
    """
    from rich.text import Text

    shown = [[(t, v) for t, v in line.points if span[0] <= t <= span[1] and math.isfinite(v)] for line in lines]
    values = [v for points in shown for _, v in points]
    text = Text(f"{title}   ")
    for line in lines:
        text.append(f"{line.mark or '━'} {line.name}  " if line.name else "", style=line.style)
    text.append("\n")
    if not values:
        return text.append("no data yet\n")
    room = 0.05 * (max(values) - min(values)) or 0.5  # the ends of the axis always differ
    low, high = bounds or (min(values) - room, max(values) + room)
    columns = max(10, width - MARGIN - 2)
    cells = _drawn(lines, shown, (columns, height), span, (low, high))
    labels = _labels(low, high, height)
    for row in range(height):
        left = f"{labels[row]:>{MARGIN - 1}} " if row % 2 == 0 else " " * MARGIN
        text.append(f"{left}│", style="dim")
        for column in range(columns):
            mask, style = cells.get((row, column), (" ", ""))
            text.append(chr(BLANK + mask) if isinstance(mask, int) else mask, style=style)
        text.append("\n")
    return text.append(_times(span, columns, label or clock), style="dim")


def _labels(low: float, high: float, height: int) -> list[str]:
    """The value of every row from the top, with the decimal places by which rows two apart differ, one at least.

    Where the margin has no room for so many, as powers of ten.
    """
    values = [high - (high - low) * row / (height - 1) for row in range(height)]
    places = max(1, math.ceil(-math.log10(2.0 * (high - low) / (height - 1))))
    labels = [f"{round(value, places) + 0.0:.{places}f}" for value in values]  # no minus before a zero
    return labels if max(map(len, labels)) < MARGIN else [f"{value:.1e}" for value in values]


def _drawn(
    lines: Sequence[Line],
    shown: Sequence[Sequence[tuple[float, float]]],
    size: tuple[int, int],
    span: tuple[float, float],
    bounds: tuple[float, float],
) -> dict[tuple[int, int], tuple[int | str, str]]:
    """Dots or mark, and colour, of every cell that a line passes through; the line drawn last gives the colour."""
    columns, rows = size
    cells: dict[tuple[int, int], tuple[int | str, str]] = {}
    for line, points in zip(lines, shown, strict=True):
        dots = [
            (
                round((t - span[0]) / max(span[1] - span[0], 1e-9) * (2 * columns - 1)),
                round((bounds[1] - v) / (bounds[1] - bounds[0]) * (4 * rows - 1)),
            )
            for t, v in points
        ]
        for x, y in dots if line.mark else _joined(dots):
            cell = (y // 4, x // 2)
            before = cells.get(cell, (0, ""))[0]
            mask = (before if isinstance(before, int) else 0) | DOTS[y % 4][x % 2]
            cells[cell] = (line.mark or mask, line.style)
    return cells


def _joined(dots: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    joined = list(dots[:1])
    for (x, y), (u, v) in itertools.pairwise(dots):
        steps = max(abs(u - x), abs(v - y))
        joined += [(round(x + (u - x) * k / steps), round(y + (v - y) * k / steps)) for k in range(1, steps + 1)]
    return joined


def _times(span: tuple[float, float], columns: int, label: Callable[[float], str]) -> str:
    first, last = label(span[0]), label(span[1])
    middle = label((span[0] + span[1]) / 2.0)
    line = first.ljust(columns)
    at = max(0, columns // 2 - len(middle) // 2)
    line = line[:at] + middle + line[at + len(middle) :]
    line = line[: columns - len(last)] + last
    return " " * (MARGIN + 1) + line + "\n"


def clock(seconds: float) -> str:
    """A time of a run in hours, minutes and seconds."""
    hours, rest = divmod(round(seconds), 3600)
    return f"{hours}:{rest // 60:02d}:{rest % 60:02d}"
