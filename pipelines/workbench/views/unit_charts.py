"""Charts of a unit of a run: model and measurement, Allan deviation, samples of a dwell, history over calibrations."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pandas as pd

from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role
from pipelines.report.residuals import band
from pipelines.report.run_pictures import allan_plot
from pipelines.workbench.state import UnitPage
from schemas.units import AXES

LABELS = {
    "force": "specific force along the axis / g",
    "unit_C": "temperature of the unit / °C",
    "time": "station time / h",
    "pose": "pose",
}
MOST_SAMPLES = 20_000
DAY_S = 86400.0


def residual_chart(page: UnitPage, residuals: pd.DataFrame, dwells: pd.DataFrame) -> Chart:
    """Residuals of a unit against force, temperature, time or pose; a click on one shows its dwell."""
    own = residuals.merge(dwells[["dwell", "time_s"]], on="dwell", how="left")
    poses = list(dict.fromkeys(own.sort_values("dwell")["pose"].astype(str)))
    traces: list[Trace] = []
    for axis in AXES:
        rows = own[own["axis"] == axis]
        x = _values(page.against, rows, poses)
        y = rows["residual_ug"].to_numpy(float)
        keys = [f"{page.unit}:{int(dwell)}" for dwell in rows["dwell"]]
        texts = tuple(
            f"{axis}, pose {pose}, dwell {int(dwell)}: {value:.4g} µg"
            for pose, dwell, value in zip(rows["pose"], rows["dwell"], y, strict=True)
        )
        traces.append(Trace(f"axis {axis}", x, y, role=cast("Role", axis), size=7, texts=texts, picks=tuple(keys)))
        places, low, high = band(x, y)
        if places.size and page.against != "pose":
            traces.append(
                Trace(f"{axis}: smooth curve, 95 %", places, low, "band", cast("Role", axis), high=high, legend=False)
            )
    names = tuple(poses) if page.against == "pose" else ()
    plot = Plot("", PlotAxis(LABELS[page.against], names=names), PlotAxis("residual / µg"), tuple(traces))
    return Chart(f"Residuals against {LABELS[page.against]}", (plot,), height=380)


def _values(against: str, rows: pd.DataFrame, poses: list[str]) -> np.ndarray:
    if against == "pose":
        place = {pose: k for k, pose in enumerate(poses)}
        shift = {"x": -0.2, "y": 0.0, "z": 0.2}
        return np.array([place[str(p)] + shift[str(a)] for p, a in zip(rows["pose"], rows["axis"], strict=True)])
    if against == "time":
        return rows["time_s"].to_numpy(float) / 3600.0
    return rows["force_g" if against == "force" else "unit_C"].to_numpy(float)


def response_chart(page: UnitPage, residuals: pd.DataFrame, dwells: pd.DataFrame) -> Chart:
    """Measured output against specific force, axis by axis, with the straight line through it."""
    plots: list[Plot] = []
    for axis in AXES:
        own = residuals[residuals["axis"] == axis].merge(dwells[["dwell", f"out_{axis}", "out_unit"]], on="dwell")
        force, output = own["force_g"].to_numpy(float), own[f"out_{axis}"].to_numpy(float)
        traces = [Trace("measured", force, output, role=cast("Role", axis), size=6,
                        picks=tuple(f"{page.unit}:{int(dwell)}" for dwell in own["dwell"]))]  # fmt: skip
        if force.size > 1 and np.ptp(force) > 0.0:
            line = np.polynomial.Polynomial.fit(force, output, 1)
            ends = np.array([force.min(), force.max()])
            traces.insert(0, Trace("straight line", ends, line(ends), "line", "muted"))
        unit = str(own["out_unit"].iloc[0]) if len(own) else ""
        plots.append(Plot(f"axis {axis}", PlotAxis("specific force / g"), PlotAxis(f"output / {unit}"), tuple(traces)))
    return Chart("Output against specific force", tuple(plots), 3, height=280)


def allan_chart(allan: pd.DataFrame) -> Chart:
    """Allan deviation with its 68 % band, and the fitted noise terms."""
    return Chart("Allan deviation", (allan_plot(allan),), height=340)


def samples_chart(samples: pd.DataFrame, title: str, unit_text: str) -> Chart:
    """The samples of one dwell, axis by axis, about their mean."""
    time = samples["time_s"].to_numpy(float)
    step = 1 + len(samples) // MOST_SAMPLES
    plots: list[Plot] = []
    for axis in AXES:
        values = samples[axis].to_numpy(float)
        mean = float(np.nanmean(values)) if np.isfinite(values).any() else 0.0
        start = float(time[0]) if time.size else 0.0
        shown = values[::step] - mean
        # one line is drawn ten times as fast as a thousand points; beside a lost sample it would hide single ones
        whole = bool(np.isfinite(shown).all())
        points = Trace(
            f"axis {axis}", time[::step] - start, shown, "line" if whole else "points", cast("Role", axis), size=3,
            width=0.8, legend=False,
        )  # fmt: skip
        plots.append(
            Plot(
                f"axis {axis}, mean {mean:.6g} {unit_text}",
                PlotAxis("time in the dwell / s"),
                PlotAxis(f"output − mean / {unit_text}"),
                (points,),
            )
        )
    return Chart(title, tuple(plots), 3, height=240)


def history_chart(rows: list[dict[str, Any]], parameter: str, unit_text: str) -> Chart:
    """One coefficient of a unit over its calibrations, with k = 2."""
    day = np.array([row["day"] for row in rows])
    value, error = (np.array([float(row[key]) for row in rows]) for key in ("value", "standard_error"))
    texts = tuple(f"{row['run']}: {row['value']:.6g} ± {2.0 * row['standard_error']:.2g} (k = 2)" for row in rows)
    points = Trace(parameter, day, value, error=2.0 * error, size=8, texts=texts)
    plot = Plot("", PlotAxis("date of measurement", dates=True), PlotAxis(f"{parameter} / {unit_text}"), (points,))
    return Chart(f"{parameter} over the calibrations of the unit", (plot,), height=280)


def parameters_of(rows: list[dict[str, Any]]) -> list[str]:
    """Names of the coefficients in a unit's history: effect, axis, and the coefficient where an effect has several."""
    return list(dict.fromkeys(parameter_of(row) for row in rows))


def parameter_of(row: dict[str, Any]) -> str:
    """The name of a coefficient."""
    return f"{row['effect']} {row['name']} {row['axis']}"
