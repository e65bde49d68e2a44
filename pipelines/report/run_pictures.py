"""Charts of a run: model and measurement of a unit, its checks, and the verification of the lot."""

from __future__ import annotations

from typing import cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.drawing.chart import Chart, ColourScale, Plot, PlotAxis, Role, Trace
from schemas.units import AXES

Array = NDArray[np.float64]

RESIDUAL = "residual / µg"
POINT = 5.0
SAME_SOAK_C = 0.5  # soaks whose temperatures differ by less need no colours


def model_chart(dwells: pd.DataFrame, residuals: pd.DataFrame) -> Chart:
    """Measurement and model against force, and the residuals against force and temperature, axis by axis."""
    scale = _soak_scale(dwells)
    largest = 1.08 * float(residuals["residual_ug"].abs().max()) or 1.0
    rows: list[list[Plot]] = [[], [], []]
    unit = str(dwells["out_unit"].iloc[0])
    for axis in AXES:
        own = residuals[residuals["axis"] == axis].merge(dwells[["dwell", "soak", f"out_{axis}"]], on="dwell")
        force, left = own["force_g"].to_numpy(float), own["residual_ug"].to_numpy(float)
        colour = None if scale is None else own["soak"].map(_soak_means(dwells)).to_numpy(float)
        texts = tuple(
            f"{axis}, pose {pose}, dwell {int(dwell)}: {value:.4g} µg"
            for pose, dwell, value in zip(own["pose"], own["dwell"], left, strict=True)
        )
        along, across = PlotAxis(f"specific force on {axis} / g"), PlotAxis(RESIDUAL, low=-largest, high=largest)
        rows[0].append(_response(own, axis, along, PlotAxis(f"output / {unit}"), colour))
        for row, x, label in (
            (1, force, along),
            (2, own["unit_C"].to_numpy(float), PlotAxis("temperature of the unit / °C")),
        ):
            points = Trace("residual", x, left, size=POINT, colour=colour, texts=texts, legend=False)
            rows[row].append(Plot("", label, across, (_zero(x), points)))
    return Chart("Model and measurement", (*rows[0], *rows[1], *rows[2]), 3, scale, height=250)


def _response(own: pd.DataFrame, axis: str, along: PlotAxis, across: PlotAxis, colour: Array | None) -> Plot:
    force, output = own["force_g"].to_numpy(float), own[f"out_{axis}"].to_numpy(float)
    traces = [Trace("measured", force, output, size=POINT, colour=colour, legend=False)]
    if force.size > 1 and np.ptp(force) > 0.0:
        ends = np.array([force.min(), force.max()])
        line = np.polynomial.Polynomial.fit(force, output, 1)(ends)
        traces.insert(0, Trace("", ends, line, "line", "muted", legend=False))
    return Plot(f"axis {axis}", along, across, tuple(traces))


def _soak_means(dwells: pd.DataFrame) -> pd.Series:
    return dwells.groupby("soak")["unit_C"].mean()


def _soak_scale(dwells: pd.DataFrame) -> ColourScale | None:
    """Colours of soaks by their mean temperature; None for one temperature."""
    means = _soak_means(dwells)
    low, high = float(means.min()), float(means.max())
    return ColourScale("temperature of the soak / °C", low, high, diverging=False) if high - low > SAME_SOAK_C else None


def _zero(x: Array) -> Trace:
    finite = x[np.isfinite(x)]
    ends = np.array([finite.min(), finite.max()]) if finite.size else np.zeros(2)
    return Trace("", ends, np.zeros(2), "line", "muted", legend=False)


def check_chart(residuals: pd.DataFrame, verification: pd.DataFrame, allan: pd.DataFrame) -> Chart:
    """Residuals by pose, the error on poses not used, and the Allan deviation; those that the run has."""
    plots = [_by_pose(residuals)]
    if len(verification):
        plots.append(_verification(verification))
    if len(allan):
        plots.append(allan_plot(allan, "Allan deviation"))
    return Chart("Checks", tuple(plots), len(plots), height=330)


def _by_pose(residuals: pd.DataFrame) -> Plot:
    poses = list(dict.fromkeys(residuals.sort_values("dwell")["pose"].astype(str)))
    place = {pose: float(number) for number, pose in enumerate(poses)}
    traces = [_zero(np.array([0.0, len(poses) - 1.0]))]
    for shift, axis in zip((-0.2, 0.0, 0.2), AXES, strict=True):
        own = residuals[residuals["axis"] == axis]
        x = np.array([place[str(pose)] + shift for pose in own["pose"]])
        texts = tuple(
            f"{axis}, pose {pose}: {value:.4g} µg" for pose, value in zip(own["pose"], own["residual_ug"], strict=True)
        )
        y = own["residual_ug"].to_numpy(float)
        traces.append(Trace(f"axis {axis}", x, y, role=cast("Role", axis), size=4.0, texts=texts))
    return Plot("residuals by pose", PlotAxis("pose", names=tuple(poses)), PlotAxis(RESIDUAL), tuple(traces))


def _verification(rows: pd.DataFrame) -> Plot:
    """Single dwells against the error expected of noise and wander; limits apply to the means of their poses."""
    number = np.arange(1.0, len(rows) + 1.0)
    expanded = 2.0 * rows["uncertainty_ug"].to_numpy(float)
    texts = tuple(f"pose {pose}: {value:.4g} µg" for pose, value in zip(rows["pose"], rows["error_ug"], strict=True))
    traces = (
        Trace("expected, k = 2", number, -expanded, "band", "muted", high=expanded),
        Trace("magnitude − g", number, rows["error_ug"].to_numpy(float), role="ink", size=6.0, texts=texts),
    )
    return Plot("poses not used by the fit", PlotAxis("verification dwell"), PlotAxis("|a| − g / µg"), traces)


def allan_plot(allan: pd.DataFrame, title: str = "") -> Plot:
    """Allan deviation with its 68 % band, the fitted noise terms, and slopes −½ and +½ as guides."""
    traces: list[Trace] = []
    for axis in AXES:
        own = allan[allan["axis"] == axis].sort_values("tau_s")
        role, tau = cast("Role", axis), own["tau_s"].to_numpy(float)
        low, high = own["low_ug"].to_numpy(float), own["high_ug"].to_numpy(float)
        traces.append(Trace(f"{axis}: 68 % interval", tau, low, "band", role, high=high, legend=False))
        traces.append(Trace(f"axis {axis}", tau, own["deviation_ug"].to_numpy(float), role=role, size=POINT))
        fitted = own["fitted_ug"].to_numpy(float)
        if np.isfinite(fitted).any():
            traces.append(Trace(f"{axis}: fitted terms", tau, fitted, "line", role, legend=False))
    return Plot(
        title,
        PlotAxis("averaging time / s", log=True),
        PlotAxis("Allan deviation / µg", log=True),
        (*traces, *_slopes(allan)),
    )


def _slopes(allan: pd.DataFrame) -> list[Trace]:
    tau = np.sort(allan["tau_s"].unique().astype(float))
    if tau.size < 2 or tau[0] <= 0.0:
        return []
    ends = tau[[0, -1]]
    first, last = (float(allan.loc[allan["tau_s"] == end, "deviation_ug"].mean()) for end in ends)
    lowest = float(allan["deviation_ug"].min())
    guides = (first * np.sqrt(ends[0] / ends), last * np.sqrt(ends / ends[1]))
    return [
        Trace("", ends, values, "line", "muted", dashed=True, legend=False)
        for values in guides
        if np.isfinite(values).all() and (values > 0.2 * lowest).all()
    ]


def lot_chart(verification: pd.DataFrame, poses: pd.DataFrame, units: list[str], limit_ug: float) -> Chart:
    """Error on the poses not used, unit by unit: single dwells in grey, the means of the poses against the limit."""
    single: list[tuple[Array, Array]] = []
    means: list[tuple[Array, Array]] = []
    texts: list[str] = []
    for position, unit in enumerate(units):
        own, dwells = poses[poses["unit"] == unit], verification[verification["unit"] == unit]
        names = own["pose"].tolist()
        places = np.linspace(-0.25, 0.25, len(names)).tolist() if len(names) > 1 else [0.0]
        spread = dict(zip(names, places, strict=True))
        among = np.array([position + spread[pose] for pose in dwells["pose"]])
        single.append((among, dwells["error_ug"].to_numpy(float)))
        means.append((np.array([position + place for place in places]), own["error_ug"].to_numpy(float)))
        texts += [f"{unit}, pose {pose}: {value:.4g} µg" for pose, value in zip(names, own["error_ug"], strict=True)]
    x, y = _joined(means)
    beyond = np.abs(y) > limit_ug
    traces = [Trace("single dwell", *_joined(single), role="muted", size=3.5)]
    for name, role, rows in (
        ("mean of a pose", "accent", ~beyond),
        ("mean of a pose, beyond the limit", "limit", beyond),
    ):
        if rows.any():
            own_texts = tuple(texts[k] for k in np.flatnonzero(rows))
            traces.append(Trace(name, x[rows], y[rows], role=cast("Role", role), size=7.0, texts=own_texts))
    if np.isfinite(limit_ug):
        ends = np.array([-0.5, len(units) - 0.5])
        traces += [
            Trace("limit", ends, np.full(2, sign * limit_ug), "line", "limit", dashed=True) for sign in (-1.0, 1.0)
        ]
    axis = PlotAxis("", names=tuple(units), low=-0.5, high=len(units) - 0.5)
    return Chart(
        "Error on poses not used by the fit", (Plot("", axis, PlotAxis("|a| − g / µg"), tuple(traces)),), height=280
    )


def _joined(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    if not parts:
        return np.zeros(0), np.zeros(0)
    return np.concatenate([x for x, _ in parts]), np.concatenate([y for _, y in parts])
