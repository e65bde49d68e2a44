"""The chart of a model's error over its versions."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipelines.drawing.chart import Chart, Plot, PlotAxis, Role, Symbol, Trace, between, level

LADDER: tuple[tuple[str, str, Role, Symbol], ...] = (
    ("fitted_ug", "fitted to this run", "before", "circle"),
    ("heldout_ug", "dwells left out", "ink", "square"),
    ("fresh_ug", "fresh run, coefficients unchanged", "after", "diamond"),
)
ASIDE = (-0.03, 0.0, 0.03)  # equal errors would cover each other


def evolution_chart(rows: list[dict[str, Any]], name: str = "") -> Chart:
    """Errors of every version beside the noise of the last; versions that a fresh run refuted are shaded.

    Parameters
    ----------
    rows : by version, see :func:`pipelines.diagnosis.confirmation.evolution`
    name : of the model
    """
    number = np.arange(len(rows), dtype=float)
    labels = tuple(_label(row) for row in rows)
    traces: list[Trace] = []
    for (key, label, role, symbol), aside in zip(LADDER, ASIDE, strict=True):
        values = np.array([np.nan if row[key] is None else float(row[key]) for row in rows])
        there = np.isfinite(values)
        if there.any():
            at, shown = number[there] + aside, values[there]
            texts = tuple(f"{label}, {labels[k]}: {values[k]:.4g} µg" for k in np.flatnonzero(there))
            traces.append(Trace(f"{label} line", at, shown, "line", role, legend=False))
            traces.append(Trace(label, at, shown, role=role, symbol=symbol, size=9.0, texts=texts))
    ends = np.array([-0.4, len(rows) - 0.6])
    if rows and rows[-1]["floor_ug"] is not None:
        traces.append(level(ends, float(rows[-1]["floor_ug"]), "good", "noise assumed by the last fit"))
    top = 1.15 * max((float(np.max(trace.y)) for trace in traces), default=1.0)
    for k, row in enumerate(rows):
        if row.get("confirmed") is False:
            about = np.array([k - 0.4, k + 0.4])
            traces.append(between(about, 0.0, top, "refuted by the fresh run", "limit"))
    across = PlotAxis("version of the model", names=labels, low=float(ends[0]), high=float(ends[1]))
    title = f"Error of {name}, version by version" if name else ""
    plot = Plot(title, across, PlotAxis("error, rms / µg", low=0.0, high=top), tuple(traces))
    return Chart("Error by version of the model", (plot,), height=320)


def _label(row: dict[str, Any]) -> str:
    parts = [f"+ {name}" for name in row["added"]] + [f"− {name}" for name in row.get("removed", ())]
    return " ".join(parts) or "start"
