"""A chart as comma-separated values: one row per point, with the labels of its axes."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from typing import Any

import numpy as np

from pipelines.drawing.chart import Chart, Plot, Trace

COLUMNS = ("plot", "series", "x_label", "x", "y_label", "y", "high", "error", "colour", "text", "pick")
_LEADS = ("=", "+", "-", "@", "\t", "\r")


def csv_text(chart: Chart) -> str:
    """The numbers of a chart; guide lines are omitted."""
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(COLUMNS)
    for plot in chart.plots:
        for trace in plot.traces:
            if trace.name:
                writer.writerows(_rows(plot, trace))
    return sink.getvalue()


def _rows(plot: Plot, trace: Trace) -> Iterator[list[str]]:
    head = [safe_cell(plot.title), safe_cell(trace.name)]
    if trace.counts is not None:
        for row, y in enumerate(trace.y):
            for column, x in enumerate(trace.x):
                if trace.counts[row, column]:
                    count = repr(float(trace.counts[row, column]))
                    yield [*head, plot.x.label, repr(float(x)), plot.y.label, repr(float(y)), "", "", count, "", ""]
        return
    for k in range(trace.x.size):
        values = [_number(array, k) for array in (trace.high, trace.error, trace.colour)]
        texts = [safe_cell(texts[k]) if texts else "" for texts in (trace.texts, trace.picks)]
        x, y = repr(float(trace.x[k])), _number(trace.y, k)
        yield [*head, plot.x.label, x, plot.y.label, y, *values, *texts]


def _number(values: np.ndarray | None, k: int) -> str:
    return "" if values is None or not np.isfinite(values[k]) else repr(float(values[k]))


def safe_cell(value: Any) -> Any:
    """A value that spreadsheets do not evaluate as a formula."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_LEADS) else value
