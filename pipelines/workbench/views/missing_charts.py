"""Charts of missing effects: residuals on the sphere and against recorded quantities, and errors by version."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role, density, symmetric
from pipelines.drawing.mollweide import project, sphere
from pipelines.report.residual_table import ResidualTable
from pipelines.report.residuals import band
from pipelines.workbench.results import Diagnosed
from pipelines.workbench.state import MissingPage

Array = NDArray[np.float64]

RESIDUAL = "residual / µg"
TURNS: dict[int, tuple[str, Any]] = {
    1: ("heating", "triangle-up"),
    -1: ("cooling", "triangle-down"),
    0: ("first soak", "circle"),
}
ROLES: dict[str, Role] = {"x": "x", "y": "y", "z": "z", "norm": "norm"}
FEW = 12  # number of units up to which all points are shown


def chosen_unit(table: ResidualTable, page: MissingPage) -> int:
    """Place of the unit that is shown: the one of the address, else the one with the largest residuals."""
    if page.unit in table.units:
        return table.units.index(page.unit)
    return int(np.nanargmax(np.nanmean(table.residual**2, axis=(1, 2))))


def chosen_driver(diagnosed: Diagnosed, page: MissingPage) -> str:
    """The quantity of the address, else the one that the residual follows most, else force."""
    known = {} if diagnosed.table is None else diagnosed.table.drivers
    drivers = [str(place["driver"]) for place in diagnosed.document["where"]]
    return next((name for name in (page.against, *drivers) if name in known), "force")


def sphere_chart(diagnosed: Diagnosed, page: MissingPage) -> Chart | None:
    """Mean residual of a unit at every pose on the whole sphere, axis by axis; before and after on one scale."""
    table = diagnosed.table
    if table is None:
        return None
    unit = chosen_unit(table, page)
    rows = [(table.residual, "" if diagnosed.before is None else ", after")]
    if diagnosed.before is not None:
        rows.insert(0, (diagnosed.before, ", before"))
    poses, place = np.unique(np.round(table.force[unit], 2) + 0.0, axis=0, return_inverse=True)
    place = place.reshape(-1)
    x, y = project(poses)
    plots: list[Plot] = []
    everything: list[Array] = []
    first = [int(np.argmax(place == k)) for k in range(len(poses))]
    for values, title in rows:
        for axis, name in enumerate(table.axes):
            own = values[unit, axis]
            means = np.array([_mean(own[place == k]) for k in range(len(poses))])
            everything.append(means)
            there = np.isfinite(means)
            texts = tuple(
                f"f = ({p[0]:+.2f}, {p[1]:+.2f}, {p[2]:+.2f}) g: {m:.3g} µg"
                for p, m in zip(poses[there], means[there], strict=True)
            )
            picks = tuple(table.pick(unit, first[k]) for k in np.flatnonzero(there))
            points = Trace(
                "mean residual",
                x[there],
                y[there],
                size=11 if len(poses) < 60 else 8,
                colour=means[there],
                texts=texts,
                picks=picks,
                legend=False,
            )
            head = "norm" if name == "norm" else f"axis {name}"
            plots.append(sphere(f"{head}{title}", (points,)))
    scale = symmetric(np.concatenate(everything), "mean residual / µg")
    return Chart(
        f"Mean residual at every pose, unit {table.units[unit]}", tuple(plots), len(table.axes), scale, height=190
    )


def driver_chart(diagnosed: Diagnosed, page: MissingPage) -> Chart | None:
    """Residuals against a recorded quantity; the previous model on the left if there is one, on one scale."""
    table = diagnosed.table
    if table is None:
        return None
    name = chosen_driver(diagnosed, page)
    label, values = table.drivers[name]
    unit = chosen_unit(table, page)
    sides = [(table.residual, "the model judged")]
    if diagnosed.before is not None:
        sides = [(diagnosed.before, "before"), (table.residual, "after")]
    largest = 1.06 * float(np.nanmax(np.abs(sides[0][0] if len(table.units) <= FEW else sides[0][0][unit])))
    plots = tuple(
        Plot(f"{title}, unit {_short(table.units[unit])}", PlotAxis(label), PlotAxis(RESIDUAL, low=-largest, high=largest),
             tuple(_driven(table, residual, values, unit, page)))
        for residual, title in sides
    )  # fmt: skip
    return Chart(f"Residuals against {label}", plots, len(plots), height=360)


def _driven(table: ResidualTable, residual: Array, values: Array, unit: int, page: MissingPage) -> list[Trace]:
    """All units in the background, the chosen one in front, and a smooth curve through it."""
    traces: list[Trace] = []
    per_axis = values.ndim == 3
    if len(table.units) > 1:
        x = np.concatenate([_along(values, axis, per_axis=per_axis).ravel() for axis in range(len(table.axes))])
        y = np.concatenate([residual[:, axis].ravel() for axis in range(len(table.axes))])
        if len(table.units) > FEW:
            traces.append(density(x, y))
        else:
            traces.append(Trace("other units", x, y, role="muted", size=3.5))
    groups = _groups(table, unit, page)
    for axis, name in enumerate(table.axes):
        x, y = _along(values, axis, per_axis=per_axis)[unit], residual[unit, axis]
        for title, role, symbol, chosen in groups(axis, name):
            there = chosen & np.isfinite(y) & np.isfinite(x)
            if there.any():
                picks = tuple(table.pick(unit, int(k)) for k in np.flatnonzero(there))
                texts = tuple(
                    f"{name}, dwell {int(table.dwells[k])}: {y[k]:.4g} µg at {x[k]:.5g}" for k in np.flatnonzero(there)
                )
                traces.append(
                    Trace(title, x[there], y[there], role=role, symbol=symbol, size=7, texts=texts, picks=picks)
                )
        places, low, high = band(x, y)
        if places.size:
            role = ROLES[name] if page.colour == "axis" else "ink"
            traces.append(Trace(f"{name}: smooth curve, 95 %", places, low, "band", role, high=high, legend=False))
    return traces


def _along(values: Array, axis: int, *, per_axis: bool) -> Array:
    return values[..., axis] if per_axis else values


def _groups(
    table: ResidualTable, unit: int, page: MissingPage
) -> Callable[[int, str], list[tuple[str, Role, Any, NDArray[np.bool_]]]]:
    """Grouping of the points of an axis: by axis alone, by the way the temperature was reached, or by slot."""
    turning = table.turning[unit]

    def by_axis(axis: int, name: str) -> list[tuple[str, Role, Any, NDArray[np.bool_]]]:
        return [(f"axis {name}" if name != "norm" else name, ROLES[name], "circle", np.ones(turning.shape, dtype=bool))]

    def by_direction(axis: int, name: str) -> list[tuple[str, Role, Any, NDArray[np.bool_]]]:
        colours = cast("dict[int, Role]", {1: "before", -1: "after", 0: "ink"})
        return [(TURNS[turn][0], colours[turn], TURNS[turn][1], turning == turn) for turn in (1, -1, 0)]

    return by_direction if page.colour == "direction" else by_axis


def slot_chart(diagnosed: Diagnosed, page: MissingPage) -> Chart | None:
    """Mean residual of every unit by slot, axis by axis: the influence of the place on the fixture."""
    table = diagnosed.table
    if table is None or "slot" not in table.drivers:
        return None
    slot = table.drivers["slot"][1][:, 0]
    shift = np.linspace(-0.18, 0.18, len(table.axes)) if len(table.axes) > 1 else np.zeros(1)
    traces = [
        Trace(f"axis {name}", slot + shift[axis], np.nanmean(np.abs(table.residual[:, axis]), axis=1), role=ROLES[name], size=8,
              texts=tuple(f"{unit}, {name}" for unit in table.units))
        for axis, name in enumerate(table.axes)
    ]  # fmt: skip
    plot = Plot("", PlotAxis("slot"), PlotAxis("mean absolute residual / µg"), tuple(traces))
    return Chart("Mean absolute residual by slot", (plot,), height=280)


def _mean(values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite)) if finite.size else float("nan")


def _short(name: str) -> str:
    return name if len(name) <= 24 else f"{name[:14]}…{name[-8:]}"
