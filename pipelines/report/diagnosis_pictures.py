"""Charts of a diagnosis: model and measurement, residuals on the sphere and against recorded quantities, errors by version."""

from collections.abc import Callable, Iterator, Sequence
from typing import Literal, cast

import numpy as np
from scipy import stats

from inertial.arrays import Array, Flags, Index
from pipelines.diagnosis.documents import VersionDocument
from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role, Symbol, between, density, level, shortened, symmetric
from pipelines.drawing.mollweide import project, sphere
from pipelines.report.residual_table import ResidualTable
from pipelines.report.residuals import DriverValues, LotResiduals, direction
from pipelines.report.smooth_curve import smooth

TURNS: tuple[tuple[int, Symbol, str], ...] = (
    (1, "triangle-up", "heating"),
    (-1, "triangle-down", "cooling"),
    (0, "circle", "first soak"),
)
TURN_ROLES: dict[int, Role] = {1: "limit", -1: "accent", 0: "ink"}
MOST_POINTS = 600
SYMBOLS: dict[str, Symbol] = {"before": "diamond", "after": "square"}
RESIDUAL = "residual / µg"
CLOSE = 60  # poses from which dots are smaller
FEW = 12  # units up to which all points are shown


def noise_chart(left: LotResiduals, floor_ug: float) -> Chart:
    """Ordered residuals against a normal distribution."""
    return Chart("Residuals and noise", (_quantiles(left, floor_ug),), height=330)


def _named(axis: str) -> str:
    return axis if axis == "norm" else f"axis {axis}"


def _quantiles(left: LotResiduals, floor_ug: float) -> Plot:
    """Ordered residuals over the noise floor against the normal distribution; the line is pure noise."""
    several = len(left.models) > 1
    ends = np.array([-3.5, 3.5])
    traces = [Trace("", ends, ends, "line", "muted", legend=False)]
    for label, values in left.models:
        ordered = np.sort(values[np.isfinite(values)]) / floor_ug
        step = max(1, ordered.size // MOST_POINTS)
        normal = stats.norm.ppf((np.arange(ordered.size) + 0.5) / ordered.size)
        name = label if several else "residuals"
        role, symbol = cast("Role", label), SYMBOLS[label]
        traces.append(Trace(name, normal[::step], ordered[::step], role=role, symbol=symbol, size=3.0, legend=several))
    across, along = PlotAxis("quantile of pure noise"), PlotAxis("residual over the floor")
    return Plot("all units: residuals and noise", across, along, tuple(traces))


def pose_chart(
    unit: str,
    axes: Sequence[str],
    force: Array,
    models: Sequence[tuple[str, Array]],
    pick: Callable[[int], str] | None = None,
) -> Chart:
    """Mean residual of a unit at every pose on the whole sphere, one row for each model, on one scale.

    Parameters
    ----------
    force : (n, 3), g
    models : name, and residuals (axes, n), µg; NaN where a dwell is missing
    pick : selection by a click on the point of a dwell
    """
    poses, first, pose = np.unique(np.round(force, 2) + 0.0, axis=0, return_index=True, return_inverse=True)
    x, y = project(poses)
    plots: list[Plot] = []
    everything: list[Array] = []
    for label, residual in models:
        for axis, values in zip(axes, residual, strict=True):
            finite = np.isfinite(values)
            there = np.unique(pose.reshape(-1)[finite])
            means = np.array([values[finite & (pose.reshape(-1) == k)].mean() for k in there])
            texts = tuple(
                f"f = ({p[0]:+.2f}, {p[1]:+.2f}, {p[2]:+.2f}) g: {mean:.3g} µg"
                for p, mean in zip(poses[there], means, strict=True)
            )
            picks = () if pick is None else tuple(pick(int(first[k])) for k in there)
            size = 11.0 if len(poses) < CLOSE else 7.0
            points = Trace(
                "mean residual", x[there], y[there], size=size, colour=means, texts=texts, picks=picks, legend=False
            )
            plots.append(sphere(_named(axis) + (f", {label}" if len(models) > 1 else ""), (points,)))
            everything.append(means)
    scale = symmetric(np.concatenate(everything), "mean residual / µg")
    return Chart(f"Mean residual at every pose, unit {unit}", tuple(plots), len(axes), scale, height=200)


def driver_chart(left: LotResiduals, drivers: list[DriverValues], temperature: Array | None) -> Chart:
    """Residuals of the shown unit against each driver, axis by axis, before and after, with smooth bands."""
    shown = [(label, values[left.shown]) for label, values in left.models]
    largest = 1.08 * (max(float(np.nanmax(np.abs(values))) for _, values in shown) or 1.0)
    across = PlotAxis(RESIDUAL, low=-largest, high=largest)
    plots: list[Plot] = []
    for row, series in enumerate(drivers):
        values = series.values[left.shown]
        turned = None if temperature is None or series.name != "unit_C" else direction(temperature[left.shown])
        for column, axis in enumerate(left.axes):
            x = values[:, column] if values.ndim > 1 else values
            traces = [level(x, 0.0, dashed=False)]
            for label, residual in shown:
                traces += _against(x, residual[column], label, turned, series.period, several=len(shown) > 1)
            plots.append(Plot(_named(axis) if row == 0 else "", PlotAxis(series.label), across, tuple(traces)))
    return Chart("Residuals against recorded quantities", tuple(plots), len(left.axes), height=235)


def _against(
    x: Array, y: Array, label: str, turned: Index | None, period: float | None, *, several: bool
) -> Iterator[Trace]:
    """Points of one model, by the way the temperature was reached where that is known, and a smooth curve."""
    role = cast("Role", label)
    groups: list[tuple[Flags, Symbol, str]] = [(np.isfinite(y), "circle", "")]
    if turned is not None:
        groups = [((turned == sign) & np.isfinite(y), mark, name) for sign, mark, name in TURNS]
    for rows, symbol, name in groups:
        words = [label] if several else []
        words += [name] if name else []
        if rows.any():
            yield Trace(
                ", ".join(words) or "residual", x[rows], y[rows], role=role, symbol=symbol, size=4.5, legend=bool(words)
            )
    yield from smooth(label, x, y, role, period)


def quantity_chart(
    table: ResidualTable,
    before: Array | None,
    quantity: str,
    unit: int,
    colour: Literal["axis", "direction", "slot"] = "axis",
    names: tuple[str, str] = ("before", "after"),
) -> Chart:
    """Residuals of a lot against a recorded quantity; the previous model, if any, on the left, on one scale.

    Parameters
    ----------
    before : residuals of the previous model, as in the table
    unit : index of the unit that stands out
    colour : what colours tell of the points of that unit: the axis, or the way the temperature was reached
    names : of the previous model and of this model
    """
    label, values = table.drivers[quantity]
    sides = (
        [(table.residual, "the model judged")] if before is None else [(before, names[0]), (table.residual, names[1])]
    )
    largest = 1.06 * float(np.nanmax(np.abs(sides[0][0] if len(table.units) <= FEW else sides[0][0][unit])))
    across = PlotAxis(RESIDUAL, low=-largest, high=largest)
    along = np.stack([values] * len(table.axes), axis=-1) if values.ndim < 3 else values
    plots = tuple(
        Plot(
            f"{title}, unit {shortened(table.units[unit], 24)}",
            PlotAxis(label),
            across,
            (*_lot(table, residual, along), *_standing_out(table, residual[unit], along[unit], unit, colour)),
        )
        for residual, title in sides
    )
    return Chart(f"Residuals against {label}", plots, len(plots), height=360)


def _lot(table: ResidualTable, residual: Array, along: Array) -> list[Trace]:
    """All units in the background: their points, or the number of points where there are many."""
    if len(table.units) < 2:
        return []
    x, y = np.moveaxis(along, -1, 0)[: len(table.axes)].ravel(), np.moveaxis(residual, 1, 0).ravel()
    return [density(x, y) if len(table.units) > FEW else Trace("other units", x, y, role="muted", size=3.5)]


def _standing_out(table: ResidualTable, residual: Array, along: Array, unit: int, colour: str) -> Iterator[Trace]:
    """The points of one unit, and a smooth curve through them."""
    turning = table.turning[unit]
    for axis, name in enumerate(table.axes):
        x, y, role = along[:, axis], residual[axis], cast("Role", name)
        groups: list[tuple[str, Role, Symbol, Flags]]
        if colour == "direction":
            groups = [(turn, TURN_ROLES[sign], symbol, turning == sign) for sign, symbol, turn in TURNS]
        else:
            groups = [(_named(name), role, "circle", np.ones(x.shape, dtype=bool))]
        for title, own_role, symbol, chosen in groups:
            there = np.flatnonzero(chosen & np.isfinite(x) & np.isfinite(y))
            if there.size:
                picks = tuple(table.pick(unit, int(k)) for k in there)
                texts = tuple(f"{name}, dwell {int(table.dwells[k])}: {y[k]:.4g} µg at {x[k]:.5g}" for k in there)
                yield Trace(title, x[there], y[there], "points", own_role, symbol, 7.0, texts=texts, picks=picks)
        yield from smooth(name, x, y, role if colour == "axis" else "ink")


def slot_chart(table: ResidualTable) -> Chart | None:
    """Mean residual of every unit by slot, axis by axis: the influence of the slot; None without slots."""
    if "slot" not in table.drivers:
        return None
    slot = table.drivers["slot"][1][:, 0]
    shift = np.linspace(-0.18, 0.18, len(table.axes)) if len(table.axes) > 1 else np.zeros(1)
    traces: list[Trace] = []
    for axis, name in enumerate(table.axes):
        mean = np.nanmean(np.abs(table.residual[:, axis]), axis=1)
        texts = tuple(f"{unit}, {name}" for unit in table.units)
        traces.append(Trace(f"axis {name}", slot + shift[axis], mean, role=cast("Role", name), size=8.0, texts=texts))
    plot = Plot("", PlotAxis("slot"), PlotAxis("mean absolute residual / µg"), tuple(traces))
    return Chart("Mean absolute residual by slot", (plot,), height=280)


LADDER: tuple[tuple[str, str, Role, Symbol], ...] = (
    ("fitted_ug", "fitted to this run", "muted", "circle"),
    ("heldout_ug", "dwells left out", "ink", "square"),
    ("fresh_ug", "fresh run, not fitted", "fourth", "diamond"),
)
ASIDE = (-0.03, 0.0, 0.03)  # equal errors would cover each other


def evolution_chart(rows: Sequence[VersionDocument], name: str = "") -> Chart:
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
        traces.append(level(ends, float(rows[-1]["floor_ug"]), "good", "noise of the last fit"))
    top = 1.15 * max((float(np.max(trace.y)) for trace in traces), default=1.0)
    for k, row in enumerate(rows):
        if row.get("confirmed") is False:
            about = np.array([k - 0.4, k + 0.4])
            traces.append(between(about, 0.0, top, "refuted by the fresh run", "limit"))
    across = PlotAxis("version of the model", names=labels, low=float(ends[0]), high=float(ends[1]))
    title = f"Error of {name}, version by version" if name else ""
    plot = Plot(title, across, PlotAxis("error, rms / µg", low=0.0, high=top), tuple(traces))
    return Chart("Error by version of the model", (plot,), height=320)


def _label(row: VersionDocument) -> str:
    parts = [f"+ {name}" for name in row["added"]] + [f"− {name}" for name in row.get("removed", ())]
    return " ".join(parts) or "start"
