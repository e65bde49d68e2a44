"""The error of a model over its versions, as a picture."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure

from pipelines.report.plots import STYLE
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

LINES = (
    ("fitted_ug", "fitted to this run", "#7a7a7a", "o", "-"),
    ("heldout_ug", "dwells left out", "#0072b2", "s", "-"),
    ("fresh_ug", "fresh run, coefficients unchanged", "#d55e00", "D", "-"),
)
ASIDE = (-0.05, 0.0, 0.05)  # equal errors would cover each other
FLOOR = "#009e73"


def draw_evolution(rows: list[dict[str, Any]], path: Path, name: str) -> None:
    """Write the picture: errors of every version beside the floor of the last; unconfirmed effects are marked."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(6.4, 2.2 + 1.5 * len(rows)), 4.6), layout="constrained")
        place = figure.subplots()
        draw(place, rows)
        place.set_title(f"Error of {name}, version by version", loc="left")
        try:
            figure.savefig(path, dpi=150, metadata={"Date": None} if path.suffix.lower() == ".svg" else None)
        except OSError as problem:
            raise WrongUse(
                f"history: {path} cannot be written ({problem.strerror}); name another file with --picture"
            ) from None


def draw(place: Axes, rows: list[dict[str, Any]]) -> None:
    """The lines of the errors over the versions."""
    at = list(range(len(rows)))
    for (key, label, colour, marker, line), aside in zip(LINES, ASIDE, strict=True):
        values = [row[key] for row in rows]
        if values[0] is not None:
            place.plot(
                [k + aside for k in at],
                values,
                line,
                color=colour,
                marker=marker,
                label=label,
                linewidth=1.6,
                markersize=6,
            )
    floor = rows[-1]["floor_ug"]
    place.axhline(floor, color=FLOOR, linestyle="--", linewidth=1.4, label="noise assumed by the last fit")
    top = max(row[key] for row in rows for key, *_ in LINES if row[key] is not None)
    for k, row in enumerate(rows):
        if row["confirmed"] is False:
            place.axvspan(k - 0.4, k + 0.4, color="#c62828", alpha=0.08, linewidth=0)
            place.annotate("refuted", (k, 1.12 * top), ha="center", color="#c62828", fontsize=9)
    place.set_xticks(at, [_label(row) for row in rows])
    place.set(ylabel="error / µg rms", ylim=(0.0, 1.42 * top), xlim=(-0.5, len(rows) - 0.5))
    place.grid(visible=False, axis="x")
    place.legend(loc="upper right", ncols=2, frameon=False, fontsize=9)


def _label(row: dict[str, Any]) -> str:
    parts = [f"+ {name}" for name in row["added"]] + [f"− {name}" for name in row["removed"]]
    return f"version {row['version']}\n" + ("\n".join(parts) or f"{len(row['effects'])} effects")
