"""Temperatures and angles of a run over the station's time, with events."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipelines.drawing import Chart, Plot, PlotAxis, Trace

MOST = 3000


def station_chart(history: pd.DataFrame, readings: pd.DataFrame, events: pd.DataFrame) -> Chart:
    """Chamber, coldest and warmest unit; angles of the table; pauses and ends as marks."""
    by_time = history.groupby("time_s")
    time = np.unique(history["time_s"].to_numpy(float))
    chamber = by_time["chamber_C"].first().to_numpy(float)
    cold, warm = by_time["unit_C"].min().to_numpy(float), by_time["unit_C"].max().to_numpy(float)
    step = 1 + time.size // MOST
    hours = time[::step] / 3600.0
    traces = [
        Trace("units, coldest to warmest", hours, cold[::step], "band", "accent", high=warm[::step]),
        Trace("chamber", hours, chamber[::step], "line", "before"),
    ]
    interruptions = events[~events["kind"].isin(["reference", "soak"])]
    if len(interruptions):
        texts = tuple(f"{row.kind}: {row.reason}" for row in interruptions.itertuples())
        place = np.full(len(interruptions), float(np.nanmin(chamber)))
        traces.append(
            Trace(
                "events",
                interruptions["time_s"].to_numpy(float) / 3600.0,
                place,
                role="limit",
                symbol="diamond",
                size=10,
                texts=texts,
            )
        )
    own = readings.drop_duplicates("record").sort_values("start_s")
    start = own["start_s"].to_numpy(float) / 3600.0
    angles = (
        Trace("outer", start, own["outer_deg"].to_numpy(float), role="x", size=4),
        Trace("inner", start, own["inner_deg"].to_numpy(float), role="y", symbol="square", size=4),
    )
    span = PlotAxis("station time / h", low=0.0, high=float(max(hours[-1], start[-1])))
    plots = (
        Plot("temperature", span, PlotAxis("temperature / °C"), tuple(traces)),
        Plot("table", span, PlotAxis("angle / °"), angles),
    )
    return Chart("Temperatures and angles over the station's time", plots, 1, height=280)
