"""Discoveries as one self-contained page: levels with intervals, evidence over the lots, smallest detectable sizes."""

import numpy as np
from numpy.typing import NDArray

from inertial.discovery.evidence import MEAN, STATION
from inertial.discovery.running_sums import growth_of
from inertial.frames import force_from_angles
from inertial.uncertainty.rounding import short
from pipelines.discovery.discoveries import Discoveries, plain
from pipelines.discovery.documents import DiscoverDocument, DiscoveryRow, UnexplainedRow
from pipelines.discovery.sentences import headline, scope_text, support_text, unexplained_text
from pipelines.drawing import Chart, Plot, PlotAxis, Trace, still, svg_text
from pipelines.drawing.chart import Role, level, symmetric
from pipelines.drawing.mollweide import project, sphere
from pipelines.report.templates import template

MOST_LEVELS = 30
FAINT = 0.5  # evidence, in powers of ten, up to which nothing is drawn


def charts_of(found: Discoveries, document: DiscoverDocument) -> dict[str, Chart]:
    """All charts of the discoveries, by name."""
    charts = {f"levels-{row['id']}": _levels_chart(row) for row in document["discoveries"] if len(row["levels"]) > 1}
    charts |= _growth_charts(found, document) | _strongest_chart(found)
    charts |= {"reach": _reach_chart(document)} if document["reach"] else {}
    return charts | {f"left-{row['id']}": _map_chart(row) for row in document["unexplained"] if row["map"]}


def render(found: Discoveries, document: DiscoverDocument, archive: str) -> str:
    """The page as one HTML text without other files."""
    return template("discoveries.html").render(
        archive=archive,
        document=document,
        short=short,
        charts={name: still(svg_text(chart)) for name, chart in charts_of(found, document).items()},
        headline=headline,
        scope=scope_text,
        support=support_text,
        unexplained=unexplained_text,
    )


def _levels_chart(row: DiscoveryRow) -> Chart:
    """The levels of a driver in order of size, with 95 % intervals."""
    levels = sorted(row["levels"][:MOST_LEVELS], key=lambda entry: entry["size_ug"])
    position = np.arange(len(levels), dtype=np.float64)
    size, error = (np.array([entry[key] for entry in levels]) for key in ("size_ug", "u_ug"))
    texts = tuple(
        f"{entry['level']}: {entry['size_ug']:.2f} ± {2 * entry['u_ug']:.2f} µg, {entry['units']} units"
        for entry in levels
    )
    traces = (level(position, 0.0), Trace("95 % interval", position, size, error=1.96 * error, size=7.0, texts=texts))
    axis = PlotAxis(row["driver"], names=tuple(entry["level"] for entry in levels))
    on = f" on {levels[0]['axis']}" if levels[0]["axis"] else ""
    plot = Plot("", axis, PlotAxis(f"{row['recommended']}{on} in a dwell / µg"), traces)
    return Chart(f"{row['recommended']} by {row['driver']}", (plot,), height=280)


def _map_chart(row: UnexplainedRow) -> Chart:
    """A difference by a driver that no effect of the catalogue explains, over the sphere of the force."""
    outer, inner, size, error = np.array(row["map"]).T
    force = force_from_angles(np.radians(outer), np.radians(inner))
    texts = tuple(
        f"f = ({x:+.2f}, {y:+.2f}, {z:+.2f}) g: {value:.3g} ± {2.0 * u:.2g} µg"
        for (x, y, z), value, u in zip(force, size, error, strict=True)
    )
    points = Trace("left", *project(force), size=11.0, colour=size, texts=texts, legend=False)
    title = f"axis {row['axes'][0]}" + (f", {row['driver']} {row['level']}" if row["level"] else "")
    note = f"95 % of a value: about ± {short(2.0 * float(np.median(error)))} µg"
    scale = symmetric(size, "what is left / µg")
    return Chart("Left by every effect of the catalogue", (sphere(title, (points,)),), 1, scale, height=260, note=note)


def _growth_charts(found: Discoveries, document: DiscoverDocument) -> dict[str, Chart]:
    """Growth of the evidence of each discovery from lot to lot, by ``grown-<id>``."""
    known = {(discovery.name.effects[0], discovery.drivers[0]): discovery.carried for discovery in found.named}
    charts: dict[str, Chart] = {}
    for row in document["discoveries"]:
        carried = known.get((row["recommended"], row["driver"]))
        if carried is None or carried.size < 2:
            continue
        lots, evidence = np.arange(1.0, carried.size + 1.0), growth_of(carried) / np.log(10.0)
        traces = Trace("evidence", lots, evidence, "line", "accent", width=2.0), level(lots, 0.0)
        plot = Plot("", PlotAxis("lots"), PlotAxis("evidence / powers of ten"), traces)
        note = "each lot against what the other half of the lots predicts of it"
        charts[f"grown-{row['id']}"] = Chart("How the evidence came together", (plot,), height=240, note=note)
    return charts


def _strongest_chart(found: Discoveries) -> dict[str, Chart]:
    """The largest evidence of each effect by each driver, in powers of ten; nothing where there is none to draw."""
    state, effects = found.state, found.source.pool.effects
    if not state.order:
        return {}
    drivers = list(dict.fromkeys(plain(name) for name in state.sensor.drivers))
    drivers.sort(key=lambda name: (name not in {MEAN, STATION}, name))
    of_hypothesis = [effects.index(hypothesis.effect) for hypothesis in state.hypotheses[: state.sensor.size]]
    grid = np.zeros((len(effects), len(drivers)))
    for name, sums in state.sensor.drivers.items():
        column = drivers.index(plain(name))
        # evidence with a higher threshold is reduced by the difference of the thresholds
        above = sums.log_e - state.needed(name)[: sums.s.size] + state.least_needed()
        np.maximum.at(grid[:, column], of_hypothesis, above / np.log(10.0))
    if grid.max(initial=0.0) <= FAINT:
        return {}
    needed = state.least_needed() / np.log(10.0)
    traces: list[Trace] = []
    shown: tuple[tuple[str, Role, NDArray[np.bool_]], ...] = (
        ("beyond the threshold", "before", grid >= needed),
        ("below it", "muted", (grid < needed) & (grid > FAINT)),
    )
    for name, role, inside in shown:
        rows, columns = np.nonzero(inside)
        texts = tuple(f"{effects[r]} by {drivers[c]}: 10^{grid[r, c]:.1f}" for r, c in zip(rows, columns, strict=True))
        at = columns.astype(float), rows.astype(float)
        traces.append(Trace(name, *at, role=role, symbol="square", size=9.0, texts=texts))
    plot = Plot("", PlotAxis("driver", names=tuple(drivers)), PlotAxis("", names=tuple(effects)), tuple(traces))
    return {"strongest": Chart("Evidence by effect and driver", (plot,), height=max(260, 18 * len(effects) + 70))}


def _reach_chart(document: DiscoverDocument) -> Chart:
    """Smallest detectable size against the number of lots, with the discoveries as points."""
    lots = document["pooled"]["lots"]
    grid = np.geomspace(30.0, max(4.0 * lots, 120.0), 40)
    best: dict[str, list[float]] = {}
    for row in document["reach"]:
        best.setdefault(row["driver"], []).append(row["smallest_ug"])
    traces: list[Trace] = []
    roles: tuple[Role, ...] = ("x", "y")
    for role, (driver, sizes) in zip(roles, best.items(), strict=False):
        middle = float(np.median(sizes))
        name = "common to all lots" if driver == MEAN else "between units of a lot"
        traces.append(Trace(name, grid, middle * np.sqrt(max(lots, 1) / grid), "line", role, width=2.0))
    rows = [row for row in document["discoveries"] if row["size_ug"] > 0.0]
    if rows:
        at = np.array([float(row["lots_then"]) for row in rows])
        texts = tuple(f"{row['id']} {row['recommended']}" for row in rows)
        sizes = np.array([row["size_ug"] for row in rows])
        traces.append(Trace("discoveries", at, sizes, role="limit", symbol="diamond", size=9.0, texts=texts))
    axes = PlotAxis("lots", log=True), PlotAxis("smallest effect / µg", log=True)
    return Chart("What an archive of so many lots shows", (Plot("", *axes, tuple(traces)),), height=280)
