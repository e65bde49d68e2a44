"""The schedule of a line as a picture, a row for each fixture and each thing that is shared, and as a table."""

import csv
import io

import numpy as np

from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role
from pipelines.drawing.picture import safe_cell
from pipelines.planning.documents import LineDocument

ROLES: dict[str, Role] = {
    "load": "before", "unload": "before", "change": "fourth", "soak": "muted", "ramp": "y", "measure": "accent",
    "static": "z", "return": "muted",
}  # fmt: skip
OTHER: Role = "after"  # equipment of procedures
NAMES = {"load": "loading, unloading", "unload": "loading, unloading", "return": "soak"}
THICK, ROW = 14.0, 40
COLUMNS = ("lot", "fixture", "activity", "temperature_C", "begin_min", "end_min", "resources")


def line_chart(document: LineDocument) -> Chart:
    """Fixtures above, shared resources and operators below them, over the hours from the start."""
    fixtures = list(dict.fromkeys(lot["fixture"] for lot in sorted(document["lots"], key=lambda lot: lot["fixture"])))
    shared = [row["resource"] for row in document["resources"] if row["resource"] != "fixtures"]
    rows = [*reversed(shared), *reversed(fixtures)]
    bars: dict[str, tuple[Role, list[float], list[float]]] = {}
    for activity in document["activities"]:
        name = NAMES.get(activity["activity"], activity["activity"])
        _, x, y = bars.setdefault(name, (ROLES.get(activity["activity"], OTHER), [], []))
        for row in (activity["fixture"], *activity["resources"]):
            x += [activity["begin_min"] / 60.0, activity["end_min"] / 60.0, np.nan]
            y += [rows.index(row)] * 2 + [np.nan]
    traces = [Trace(name, np.array(x), np.array(y), "line", role, width=THICK) for name, (role, x, y) in bars.items()]
    spans = [
        (lot["loaded_min"] / 60.0, lot["unloaded_min"] / 60.0, rows.index(lot["fixture"])) for lot in document["lots"]
    ]
    waits = Trace(
        "lot in its fixture",
        np.array([(begin, end, np.nan) for begin, end, _ in spans]).ravel(),
        np.array([(row, row, np.nan) for _, _, row in spans]).ravel(),
        "line",
        "ink",
        width=1.2,
    )
    labels = Trace(
        "lots",
        np.array([0.5 * (begin + end) for begin, end, _ in spans]),
        np.array([row + 0.42 for _, _, row in spans]),
        "labels",
        "ink",
        texts=tuple(lot["lot"] for lot in document["lots"]),
        legend=False,
    )
    hours = PlotAxis("h from the start", low=0.0, high=1.01 * document["makespan_min"] / 60.0)
    names = PlotAxis("", names=tuple(rows), low=-0.6, high=len(rows) - 0.2)
    plot = Plot("", hours, names, (waits, *traces, labels))
    return Chart(f"Schedule of the line {document['line']}", (plot,), height=90 + ROW * len(rows))


def line_csv(document: LineDocument) -> str:
    """Every activity as a row; several resources are divided by semicolons."""
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(COLUMNS)
    for activity in document["activities"]:
        texts = [activity["lot"], activity["fixture"], activity["activity"]]
        numbers = [
            "" if (heat := activity["temperature_C"]) is None else heat,
            round(activity["begin_min"], 3),
            round(activity["end_min"], 3),
        ]
        writer.writerow([*map(safe_cell, texts), *numbers, safe_cell("; ".join(activity["resources"]))])
    return sink.getvalue()
