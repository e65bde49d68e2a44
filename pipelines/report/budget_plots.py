"""Shares of the contributions to an uncertainty, as bars."""

from collections.abc import Mapping
from html import escape

from pipelines.drawing.vector import LETTER, WIDTH, part, text_at

SMALLEST = 0.01
COLOURS = (
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6bb1", "#7f7f7f", "#a6761d", "#66a61e", "#1b4f72",
)  # fmt: skip
REST = "#d9d9d9"
LINE, THICK, ENTRY, COLUMNS = 34.0, 22.0, 22.0, 3
RIGHT = 24.0


def shares_plot(shares: Mapping[str, Mapping[str, float]]) -> str:
    """One bar per quantity, divided by the shares of u²; contributions below 1 % everywhere are combined as others.

    Parameters
    ----------
    shares : by title of the quantity, then by contribution; each sums to 1
    """
    every = dict.fromkeys(name for by_name in shares.values() for name in by_name)
    names = [name for name in every if max(by_name.get(name, 0.0) for by_name in shares.values()) >= SMALLEST]
    names.sort(key=lambda name: -sum(by_name.get(name, 0.0) for by_name in shares.values()))
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(names)}
    rest = {title: max(0.0, 1.0 - sum(by_name.get(name, 0.0) for name in names)) for title, by_name in shares.items()}
    if max(rest.values(), default=0.0) > 1e-3:
        colours["others"] = REST
    left = 16.0 + LETTER * max((len(title) for title in shares), default=0)
    wide, bottom = WIDTH - left - RIGHT, LINE * len(shares) + 4.0
    parts: list[str] = []
    for row, (title, by_name) in enumerate(shares.items()):
        top, at = LINE * row + 6.0, left
        parts.append(text_at(left - 8.0, top + 0.5 * THICK + 4.0, title, 'text-anchor="end"'))
        for name, colour in colours.items():
            share = rest[title] if name == "others" else by_name.get(name, 0.0)
            if share > 0.0:
                tip = f"<title>{escape(name)}: {100.0 * share:.3g} %</title>"
                parts.append(
                    f'<path d="M{at:.1f} {top:.1f}h{wide * share:.2f}v{THICK:g}H{at:.1f}z" fill="{colour}">{tip}</path>'
                )
            at += wide * share
    parts.append(f'<path d="M{left:.1f} 0v{bottom:g}h{wide:.1f}" stroke="#8a8f98" fill="none"/>')
    parts += [
        text_at(left + wide * tenth / 5.0, bottom + 16.0, f"{20 * tenth} %", 'text-anchor="middle"')
        for tenth in range(6)
    ]
    parts.append(text_at(left + 0.5 * wide, bottom + 36.0, "share of u²", 'text-anchor="middle"'))
    across = (WIDTH - 2.0 * RIGHT) / COLUMNS
    for number, (name, colour) in enumerate(colours.items()):
        x, y = RIGHT + across * (number % COLUMNS), bottom + 54.0 + ENTRY * (number // COLUMNS)
        parts.append(f'<path d="M{x:.1f} {y:.1f}h18v10h-18z" fill="{colour}"/>{text_at(x + 26.0, y + 9.5, name)}')
    height = bottom + 58.0 + ENTRY * -(-len(colours) // COLUMNS)
    return part("shares of the contributions to u²", height, "".join(parts))
