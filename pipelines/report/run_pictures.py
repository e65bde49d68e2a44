"""Charts of a run: model and measurement of a unit, its checks and samples, the verification of the lot, the station."""

from typing import Any, cast

import numpy as np
import pandas as pd

from inertial.quantities import BY_COLUMN, axis_labels, is_clock, is_covariate, shown_factor
from inertial.state import State
from pipelines.drawing.chart import Chart, ColourScale, Plot, PlotAxis, Role, Trace, level, measured_curve
from pipelines.report.effect_view import BOTH_SIDES, followed
from pipelines.report.residuals import STILL
from pipelines.report.smooth_curve import smooth
from schemas.errors import WrongUse, did_you_mean
from schemas.units import AXES, axes_among

RESIDUAL = "residual / µg"
POINT = 5.0
SAME_SOAK_C = 0.5  # soaks whose temperatures differ by less need no colours
MOST_SAMPLES = 20_000  # of a dwell, and
MOST_TIMES = 3000  # of a station, that are drawn
ALWAYS = {"force": "specific force along the axis / g", "time": "station time / h"}
"""What residuals can be drawn against in every run; then what it recorded, and the pose."""
COLUMNS = {"force": "force_g", "time": "time_s"}
POSE = "pose"
RATED = 3  # dwells from which a rate between neighbours can be told
POSE_SHIFT = {"x": -0.2, "y": 0.0, "z": 0.2}


def model_chart(dwells: pd.DataFrame, residuals: pd.DataFrame) -> Chart:
    """The residuals against force and temperature, axis by axis."""
    scale = _soak_scale(dwells)
    largest = 1.08 * float(residuals["residual_ug"].abs().max()) or 1.0
    across = PlotAxis(RESIDUAL, low=-largest, high=largest)
    rows: list[list[Plot]] = [[], []]
    for axis in axes_among(residuals["axis"]):
        of_axis = residuals[residuals["axis"] == axis].merge(dwells[["dwell", "soak"]], on="dwell")
        force, left = of_axis["force_g"].to_numpy(float), of_axis["residual_ug"].to_numpy(float)
        colour = None if scale is None else of_axis["soak"].map(_soak_means(dwells)).to_numpy(float)
        along = PlotAxis(f"specific force on {axis} / g"), PlotAxis(axis_labels()["unit_C"])
        titles = f"axis {axis}", ""
        for row, title, x, label in zip(rows, titles, (force, of_axis["unit_C"].to_numpy(float)), along, strict=True):
            points = Trace("residual", x, left, size=POINT, colour=colour, texts=_told(of_axis), legend=False)
            row.append(Plot(title, label, across, (level(x, 0.0, dashed=False), points)))
    return Chart("Model and measurement", (*rows[0], *rows[1]), len(rows[0]), scale, height=250)


def quantities(residuals: pd.DataFrame, dwells: pd.DataFrame) -> dict[str, str]:
    """Quantities against which residuals of a unit can be drawn, by name, with label: force, time, what was recorded, pose.

    Of what was recorded, that which varied between its dwells.
    """
    labels = axis_labels()
    rated = _with_rate(dwells)
    fitted = rated[rated["dwell"].isin(residuals["dwell"])].select_dtypes("number")
    columns = [
        *(name for name in BY_COLUMN if name in fitted),
        *(name for name in map(str, fitted.columns) if is_covariate(name)),
    ]
    varied = [name for name in dict.fromkeys(columns) if name != COLUMNS["time"] and np.ptp(fitted[name]) > 0.0]
    return {**ALWAYS, **{name: labels.get(name, name) for name in varied}, POSE: POSE}


def follows_most(residuals: pd.DataFrame, dwells: pd.DataFrame) -> str:
    """The quantity that the residuals of a unit depend on most; the mean over its axes decides."""
    axes = [of_axis for _, of_axis in timed(residuals, dwells).groupby("axis")]

    def share(name: str) -> float:
        column = COLUMNS.get(name, name)
        return sum(
            followed(of_axis[column].to_numpy(float), of_axis["residual_ug"].to_numpy(float)) for of_axis in axes
        )

    # a clock beside the time says nothing else, and neither does a pose beside its force
    return max((name for name in quantities(residuals, dwells) if name != POSE and not is_clock(name)), key=share)


def timed(residuals: pd.DataFrame, dwells: pd.DataFrame) -> pd.DataFrame:
    """Residuals with what was recorded at their dwells."""
    recorded = _with_rate(dwells)
    return residuals.merge(recorded[["dwell", *recorded.columns.difference(residuals.columns)]], on="dwell", how="left")


def _with_rate(dwells: pd.DataFrame) -> pd.DataFrame:
    """Dwells of a unit with the rate of its temperature, where it changes while they are taken."""
    if "unit_C" not in dwells or len(dwells) < RATED:
        return dwells
    time, temperature = (dwells[name].to_numpy(float) for name in ("time_s", "unit_C"))
    rate = State(np.zeros((time.size, 3)), time=time, temperature=temperature).temperature_rate
    return dwells if rate is None or np.ptp(rate) < STILL["temperature_rate"] else dwells.assign(temperature_rate=rate)


def residual_chart(unit: str, residuals: pd.DataFrame, dwells: pd.DataFrame, against: str) -> Chart:
    """Residuals of a unit against one of its quantities, with what noise alone leaves; a click shows the dwell."""
    known = quantities(residuals, dwells)
    if against not in known:
        raise WrongUse(f"figure: no '{against[:80]}' was recorded that varied; {did_you_mean(against, known)}")
    plot = _residuals("", timed(residuals, dwells), (against, known[against]), 7.0, unit)
    return Chart(f"Residuals against {known[against]}", (plot,), height=380)


def _residuals(title: str, residuals: pd.DataFrame, against: tuple[str, str], size: float, unit: str = "") -> Plot:
    """Residuals of all axes against a quantity, by name and label; points of a named unit can be selected."""
    quantity, label = against
    poses = list(dict.fromkeys(residuals.sort_values("dwell")["pose"].astype(str)))
    column = COLUMNS.get(quantity, quantity)
    traces: list[Trace] = []
    for axis in axes_among(residuals["axis"]):
        of_axis = residuals[residuals["axis"] == axis]
        y, role = of_axis["residual_ug"].to_numpy(float), cast("Role", axis)
        if quantity == POSE:
            x = np.array([poses.index(str(pose)) + POSE_SHIFT[axis] for pose in of_axis["pose"]])
        else:
            x = of_axis[column].to_numpy(float) * shown_factor(column)
        picks = tuple(f"{unit}:{int(dwell)}" for dwell in of_axis["dwell"]) if unit else ()
        error = BOTH_SIDES * of_axis["expected_ug"].to_numpy(float) if unit and "expected_ug" in of_axis else None
        traces.append(Trace(f"axis {axis}", x, y, role=role, size=size, texts=_told(of_axis), picks=picks, error=error))
        traces += [] if quantity == POSE else smooth(axis, x, y, role)
    zero = level(np.concatenate([trace.x for trace in traces]), 0.0, dashed=False)
    names = tuple(poses) if quantity == POSE else ()
    return Plot(title, PlotAxis(label, names=names), PlotAxis(RESIDUAL), (zero, *traces))


def _told(rows: pd.DataFrame) -> tuple[str, ...]:
    columns = (rows[name] for name in ("axis", "pose", "dwell", "residual_ug"))
    return tuple(
        f"{axis}, pose {pose}, dwell {int(dwell)}: {left:.4g} µg"
        for axis, pose, dwell, left in zip(*columns, strict=True)
    )


def _soak_means(dwells: pd.DataFrame) -> pd.Series:
    return dwells.groupby("soak")["unit_C"].mean()


def _soak_scale(dwells: pd.DataFrame) -> ColourScale | None:
    """Colours of soaks by their mean temperature; None for one temperature."""
    means = _soak_means(dwells)
    low, high = float(means.min()), float(means.max())
    return ColourScale("temperature of the soak / °C", low, high, diverging=False) if high - low > SAME_SOAK_C else None


def check_chart(residuals: pd.DataFrame, verification: pd.DataFrame, allan: pd.DataFrame) -> Chart:
    """Residuals by pose, the error on poses not used, and the Allan deviation; those that the run has."""
    plots = [_residuals("residuals by pose", residuals, (POSE, POSE), 4.0)]
    if len(verification):
        plots.append(_verification(verification))
    if len(allan):
        plots.append(allan_plot(allan, "Allan deviation"))
    return Chart("Checks", tuple(plots), len(plots), height=330)


def _verification(rows: pd.DataFrame) -> Plot:
    """Single dwells against the error expected of noise and wander; limits apply to the means of their poses."""
    number = np.arange(1.0, len(rows) + 1.0)
    expanded = 2.0 * rows["uncertainty_ug"].to_numpy(float)
    texts = tuple(f"pose {pose}: {value:.4g} µg" for pose, value in zip(rows["pose"], rows["error_ug"], strict=True))
    traces = (
        Trace("expected, k = 2", number, -expanded, "band", "muted", high=expanded),
        Trace("error", number, rows["error_ug"].to_numpy(float), role="ink", size=6.0, texts=texts),
    )
    return Plot("poses not used by the fit", PlotAxis("verification dwell"), PlotAxis("error of |a| / µg"), traces)


def allan_plot(allan: pd.DataFrame, title: str = "") -> Plot:
    """Allan deviation with its 68 % band, the fitted noise terms, and slopes −½ and +½ as guides."""
    traces: list[Trace] = []
    for axis in axes_among(allan["axis"]):
        curve = allan[allan["axis"] == axis].sort_values("tau_s")
        tau, deviation, low, high, fitted = (
            curve[name].to_numpy(float) for name in ("tau_s", "deviation_ug", "low_ug", "high_ug", "fitted_ug")
        )
        names = f"{axis}: 68 % interval", f"axis {axis}", f"{axis}: fitted terms"
        traces += measured_curve(names, cast("Role", axis), tau, deviation, (low, high), fitted)
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
    single, means = [np.zeros((2, 0))], [np.zeros((2, 0))]
    texts: list[str] = []
    for position, unit in enumerate(units):
        of_unit, dwells = poses[poses["unit"] == unit], verification[verification["unit"] == unit]
        names = of_unit["pose"].tolist()
        offsets = np.linspace(-0.25, 0.25, len(names)).tolist() if len(names) > 1 else [0.0]
        spread = dict(zip(names, offsets, strict=True))
        among = [position + spread[pose] for pose in dwells["pose"]]
        single.append(np.array([among, dwells["error_ug"]], dtype=float))
        means.append(np.array([[position + offset for offset in offsets], of_unit["error_ug"]], dtype=float))
        texts += [
            f"{unit}, pose {pose}: {value:.4g} µg" for pose, value in zip(names, of_unit["error_ug"], strict=True)
        ]
    x, y = np.concatenate(means, axis=1)
    beyond = np.abs(y) > limit_ug
    traces = [Trace("single dwell", *np.concatenate(single, axis=1), role="muted", size=3.5)]
    for name, role, rows in (
        ("mean of a pose", "accent", ~beyond),
        ("mean of a pose, beyond the limit", "limit", beyond),
    ):
        if rows.any():
            own_texts = tuple(texts[k] for k in np.flatnonzero(rows))
            traces.append(Trace(name, x[rows], y[rows], role=cast("Role", role), size=7.0, texts=own_texts))
    if np.isfinite(limit_ug):
        ends = np.array([-0.5, len(units) - 0.5])
        traces += [level(ends, sign * limit_ug, "limit", "limit") for sign in (-1.0, 1.0)]
    axis = PlotAxis("", names=tuple(units), low=-0.5, high=len(units) - 0.5)
    return Chart(
        "Error on poses not used by the fit",
        (Plot("", axis, PlotAxis("error of |a| / µg"), tuple(traces)),),
        height=280,
    )


def samples_chart(samples: pd.DataFrame, title: str, unit_text: str) -> Chart:
    """The samples of one dwell, axis by axis, about their mean."""
    time = samples["time_s"].to_numpy(float)
    step = 1 + len(samples) // MOST_SAMPLES
    plots: list[Plot] = []
    for axis in (a for a in AXES if samples[a].notna().any()):
        values = samples[axis].to_numpy(float)
        mean = float(np.nanmean(values)) if np.isfinite(values).any() else 0.0
        shown = values[::step] - mean
        # one line is drawn ten times as fast as a thousand points; beside a lost sample it would hide single ones
        style = "line" if np.isfinite(shown).all() else "points"
        role = cast("Role", axis)
        points = Trace(f"axis {axis}", (time - time[:1])[::step], shown, style, role, size=3.0, width=0.8, legend=False)
        across = PlotAxis("time in the dwell / s"), PlotAxis(f"output − mean / {unit_text}")
        plots.append(Plot(f"axis {axis}, mean {mean:.6g} {unit_text}", *across, (points,)))
    return Chart(title, tuple(plots), 3, height=240)


def history_chart(rows: list[dict[str, Any]], parameter: str, unit_text: str) -> Chart:
    """One coefficient of a unit over its calibrations, with k = 2."""
    day, value, error = (np.array([float(row[key]) for row in rows]) for key in ("day", "value", "standard_error"))
    texts = tuple(f"{row['run']}: {row['value']:.6g} ± {2.0 * row['standard_error']:.2g} (k = 2)" for row in rows)
    points = Trace(parameter, day, value, error=2.0 * error, size=8.0, texts=texts)
    plot = Plot("", PlotAxis("date of measurement", dates=True), PlotAxis(f"{parameter} / {unit_text}"), (points,))
    return Chart(f"{parameter} over the calibrations of the unit", (plot,), height=280)


def station_chart(history: pd.DataFrame, readings: pd.DataFrame, events: pd.DataFrame) -> Chart:
    """Chamber, coldest and warmest unit; angles of the table; pauses and ends as marks."""
    by_time = history.groupby("time_s")
    time = np.unique(history["time_s"].to_numpy(float))
    chamber = by_time["chamber_C"].first().to_numpy(float)
    cold, warm = by_time["unit_C"].min().to_numpy(float), by_time["unit_C"].max().to_numpy(float)
    step = 1 + time.size // MOST_TIMES
    hours = time[::step] / 3600.0
    traces = [
        Trace("units, coldest to warmest", hours, cold[::step], "band", "accent", high=warm[::step]),
        Trace("chamber", hours, chamber[::step], "line", "before"),
    ]
    marked = events[~events["kind"].isin(["reference", "soak"])]
    if len(marked):
        when = marked["time_s"].to_numpy(float) / 3600.0
        texts = tuple(f"{row.kind}: {row.reason}" for row in marked.itertuples())
        lowest = np.full(len(marked), float(np.nanmin(chamber)))
        traces.append(Trace("events", when, lowest, role="limit", symbol="diamond", size=10.0, texts=texts))
    records = readings.drop_duplicates("record").sort_values("start_s")
    start = records["start_s"].to_numpy(float) / 3600.0
    angles = (
        Trace("outer", start, records["outer_deg"].to_numpy(float), role="z", size=4.0),
        Trace("inner", start, records["inner_deg"].to_numpy(float), role="fourth", symbol="square", size=4.0),
    )
    span = PlotAxis("station time / h", low=0.0, high=float(max(hours[-1], start[-1])))
    plots = (
        Plot("temperature", span, PlotAxis("temperature / °C"), tuple(traces)),
        Plot("table", span, PlotAxis("angle / °"), angles),
    )
    return Chart("Temperatures and angles over the station's time", plots, 1, height=280)
