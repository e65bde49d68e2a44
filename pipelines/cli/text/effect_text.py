"""The first picture of a diagnosis at a terminal: the residual against the quantity of the missing effect, before and after."""

import math
from itertools import zip_longest
from typing import TYPE_CHECKING

import numpy as np

from pipelines.cli.chart import Line, chart
from pipelines.cli.printing import console, say

if TYPE_CHECKING:
    from rich.text import Text

    from pipelines.report.effect_view import EffectView

HEIGHT = 9
WIDEST, GAP = 120, 2
LEAST = 36  # characters of a picture beside another one


def print_view(view: "EffectView") -> None:
    """Print the picture, before and after beside each other where there is room."""
    width = min(console().width, WIDEST)
    sides = len(view.sides)
    beside = (width - GAP * (sides - 1)) // sides
    drawn = [_side(view, name, beside if beside >= LEAST else width) for name, _ in view.sides]
    say(f"{view.title}: {view.where}, in µg; line: {_line_is(view)}", style="bold")
    if beside >= LEAST:
        for parts in zip_longest(*(side.split("\n") for side in drawn)):
            line = parts[0].copy()
            for part in parts[1:]:
                line.pad_right(beside + GAP - line.cell_len)
                line.append_text(part)
            console().print(line, soft_wrap=True)
    else:
        for side in drawn:
            console().print(side)
    say(f"across: {view.quantity}", style="dim")


def _line_is(view: "EffectView") -> str:
    others = " (thin: the other units)" if len(view.units) > 1 else ""
    if not view.effect:
        return "a smooth curve" if view.curve is not None else "zero"
    return f"what {view.effect} explains{others}"


def _side(view: "EffectView", name: str, width: int) -> "Text":
    residual = dict(view.sides)[name]
    x = view.x[view.shown]
    span = (float(np.nanmin(x)), float(np.nanmax(x)))
    lines = [Line("", "dim", [(span[0], 0.0), (span[1], 0.0)])]
    if name == "before" and view.curve is not None:
        lines += [Line("", "bright_black", _points(*view.line(k))) for k in range(len(view.units)) if k != view.shown]
    lines.append(Line("", "yellow" if name == "before" else "cyan", _points(x, residual), mark="•"))
    if name == "before" and view.curve is not None:
        lines.append(Line("", "bold", _points(*view.line(view.shown))))
    largest = view.largest(name)
    title = f"{name}{'' if name == 'before' or view.on_one_scale else ', finer scale'}" if view.effect else ""
    places = max(0, 2 - math.floor(math.log10((span[1] - span[0]) or 1.0)))

    def label(value: float) -> str:
        return f"{round(value, places) + 0.0:.{places}f}"

    made = chart(title, lines, width - 1, HEIGHT, span, bounds=(-largest, largest), label=label)
    made.rstrip()
    return made


def _points(x: np.ndarray, y: np.ndarray) -> list[tuple[float, float]]:
    return list(zip(x.tolist(), y.tolist(), strict=True))
