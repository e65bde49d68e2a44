"""The page of a plan: one HTML file that opens without a network."""

from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.frames import force_from_angles
from inertial.planning.visibility import confounding
from pipelines.drawing import still, svg_text
from pipelines.drawing.chart import Chart, ColourScale, Plot, PlotAxis, Role, Symbol, Trace
from pipelines.drawing.mollweide import project, sphere
from pipelines.planning.context import PlanContext
from pipelines.planning.documents import worst_axes
from pipelines.report.budget_plots import shares_plot
from pipelines.report.numbers import axes_of, axis_word, scientific, side_by_side, significant
from pipelines.report.templates import template
from pipelines.report.unit_panels.budget import NAMES
from pipelines.schedule.timing import temperatures
from schemas.decisions import LARGEST_ERROR
from schemas.units import AXES


def render_plan(document: dict[str, Any], context: PlanContext) -> str:
    """The page as one HTML text that needs no other file.

    Parameters
    ----------
    document : of :func:`pipelines.planning.plan.plan`
    context : the recipe on the station
    """
    lines = side_by_side(document["coefficients"], lambda row: significant(row["uncertainty_ug"]), "unit")
    return template("plan.html").render(
        document=document,
        recipe=context.recipe,
        number=significant,
        scientific=scientific,
        coefficients=lines,
        axes=axes_of(lines),
        names=NAMES,
        axis_word=axis_word,
        seen=[row for row in document["effects"] if row["seen"]],
        unseen=[row for row in document["effects"] if not row["seen"]],
        **{name: picture and still(picture) for name, picture in pictures(document, context).items()},
    )


def pictures(document: dict[str, Any], context: PlanContext) -> dict[str, str]:
    """The pictures of a plan by name, as SVG: poses, temperatures, remaining fractions, confounded effects."""
    aliases = alias_chart(context)
    return {
        "sphere": svg_text(sphere_chart(context)),
        "temperature": svg_text(temperature_chart(context)),
        "sights": svg_text(sight_chart(document["effects"])),
        "aliases": "" if aliases is None else svg_text(aliases),
        "budget": _budget(document.get("uncertainty")),
    }


def _budget(reach: dict[str, Any] | None) -> str:
    """Shares of the contributions to the reachable uncertainty, of the worst axis of each quantity; empty if none is stated."""
    if reach is None:
        return ""
    worst = worst_axes(reach)
    titles = {
        "bias_error": "error by the references",
        "bias_error_period": "error over the period",
        "verification_norm": "error in a verification pose, with noise",
    }
    worst.pop(LARGEST_ERROR, None)  # it has the contributions of its parts
    return shares_plot(
        {f"{titles.get(q, q)}, {axis_word(row['axis'])}": row["shares"] for q, row in worst.items() if row["shares"]}
    )


KINDS: tuple[tuple[str, str, Role, Symbol], ...] = (
    ("dwell", "fit", "accent", "circle"),
    ("verification", "verification", "before", "square"),
    ("allan", "static record", "z", "diamond"),
)
CELL = 18.0  # of a confounded pair and of an effect, pixels
CONFOUNDED, ALIKE = 0.98, 1.0 - 1e-9


def sphere_chart(context: PlanContext) -> Chart:
    """Directions of specific force in the fixture for every pose, with the order in the first soak."""
    traces: list[Trace] = []
    first = [a for a in context.activities if a.kind == "dwell" and a.step.soak == context.activities[0].step.soak]
    for kind, label, role, symbol in KINDS[:2]:
        poses = [a.step.pose for a in context.activities if a.kind == kind]
        if poses:
            named = {(pose.outer_deg, pose.inner_deg): pose.name for pose in poses}
            outer, inner = np.radians(np.array(list(named))).T
            x, y = project(force_from_angles(outer, inner))
            texts = tuple(f"{name}: outer {o:g}°, inner {i:g}°" for (o, i), name in named.items())
            picks = tuple(named.values())
            traces.append(Trace(label, x, y, role=role, symbol=symbol, size=11.0, texts=texts, picks=picks))
    if len(first) > 1:
        outer, inner = np.radians(np.array([(a.step.pose.outer_deg, a.step.pose.inner_deg) for a in first])).T
        x, y = project(force_from_angles(outer, inner))
        numbers = tuple(str(k + 1) for k in range(len(first)))
        traces.append(
            Trace(
                "order in the first soak",
                x + 0.03,
                y,
                "labels",
                "ink",
                texts=numbers,
                legend=False,
                anchors=("top right",) * len(numbers),
            )
        )
    return Chart(
        "Poses of the plan: where specific force points in the fixture", (sphere("", tuple(traces)),), height=420
    )


def temperature_chart(context: PlanContext) -> Chart:
    """Chamber and slowest device over the station's time, with the times of the measurements."""
    time, air, device = np.array(temperatures(context.activities, context.station)).T
    hours = time / 3600.0
    low = float(min(air.min(), device.min()))
    span = float(max(air.max(), device.max())) - low or 1.0
    traces = [Trace("chamber", hours, air, "line", "muted"), Trace("slowest device", hours, device, "line", "ink")]
    for row, (kind, label, role, symbol) in enumerate(KINDS):
        activities = [a for a in context.activities if a.kind == kind]
        if activities:
            x = np.array([a.start + 0.5 * a.seconds for a in activities]) / 3600.0
            y = np.full(x.shape, low - (0.08 + 0.06 * row) * span)
            lasting = np.array([(a.start, a.start + a.seconds, np.nan) for a in activities]).ravel() / 3600.0
            traces.append(Trace("", lasting, np.repeat(y, 3), "line", role, width=5.0, legend=False))
            texts = tuple(f"{label}: {a.step.pose.name}" for a in activities)
            traces.append(Trace(label, x, y, role=role, symbol=symbol, size=5.0, texts=texts))
    plot = Plot("", PlotAxis("station time / h"), PlotAxis("temperature / °C"), tuple(traces))
    return Chart("Temperatures and records over the station's time", (plot,), height=340)


def alias_chart(context: PlanContext) -> Chart | None:
    """Confounding: cosine of the row's effect with the span of the column's, after the model; None without effects outside it."""
    names, cosines = confounding(context.state, context.recipe.effects)
    if not names:
        return None
    order = _grouped(cosines)
    labels, cosines = tuple(names[k] for k in order), cosines[np.ix_(order, order)]
    row, column = (index.ravel().astype(float) for index in np.indices(cosines.shape))
    value = cosines.ravel()
    size = len(labels)
    row = size - 1.0 - row
    cells = Trace("cosine", column, row, symbol="square", size=CELL - 3.0, colour=value, legend=False)
    marked = (value > CONFOUNDED) & (size - 1.0 - row != column)
    signs = tuple("=" if cosine > ALIKE else "≈" for cosine in value[marked])
    traces = (cells, Trace("", column[marked], row[marked], "labels", "ink", texts=signs, legend=False))
    across = PlotAxis("", names=labels, low=-0.6, high=size - 0.4)
    along = PlotAxis("", names=labels[::-1], low=-0.6, high=size - 0.4)
    scale = ColourScale("cosine of the row's effect with the column's", 0.0, 1.0, diverging=False)
    return Chart("Confounded effects", (Plot("", across, along, traces),), scale=scale, height=round(90 + CELL * size))


def _grouped(cosines: Array) -> list[int]:
    """Order of rows in which each follows the effect that it is most confounded with."""
    like = np.maximum(cosines, cosines.T)
    left = set(range(len(like)))
    order = [0]
    while left := left - {order[-1]}:
        order.append(max(left, key=lambda k: float(like[order[-1], k])))
    return order


def sight_chart(effects: list[dict[str, Any]]) -> Chart:
    """Remaining fraction v of every effect by axis."""
    shown = sorted(effects, key=lambda row: row["left"])
    heights = np.arange(len(shown), dtype=float)
    fractions = np.array([row["left_by_axis"] for row in shown]).T
    traces = [
        Trace(f"sensor axis {axis}", left, heights + 0.2 * (1 - k), role=axis)
        for k, (axis, left) in enumerate(zip(AXES, fractions, strict=False))
    ]
    across = PlotAxis("v, fraction of the effect that remains after the model", low=-0.02, high=1.02)
    along = PlotAxis("", names=tuple(str(row["effect"]) for row in shown), low=-0.6, high=len(shown) - 0.4)
    return Chart("Remaining fractions", (Plot("", across, along, tuple(traces)),), height=round(80 + CELL * len(shown)))
