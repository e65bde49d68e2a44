"""Figures of a named discovery (size, levels, robustness, next action), and the discovery in sentences."""

import math
from typing import Any, Literal

import numpy as np

from inertial.arrays import Array
from inertial.discovery.evidence import INSIDE, MEAN, SLOT, STATION
from inertial.discovery.naming import Name
from inertial.discovery.running_sums import Sums
from inertial.uncertainty.rounding import short
from pipelines.discovery.documents import DiscoveredLevel, DiscoveryRow, UnexplainedRow
from schemas.units import MICRO

Scope = Literal["sensor", "station", "sensor_or_station", "thermometer"]

_SHOWN_LEVELS = 40


def plain(driver: str) -> str:
    """The name of a driver without the suffix of judgement within lots."""
    return driver.removesuffix(INSIDE)


def by_axis(name: Name) -> list[float]:
    """Rms size of each axis over the levels, g, corrected for noise."""
    weight, _, squares = _squares(name)
    return np.sqrt(np.maximum((weight * squares).sum(axis=0), 0.0)).tolist()


def _squares(name: Name) -> tuple[Array, Array, Array]:
    """Weights of the levels (n, 1); standard errors (zero if unknown), g, and squares less noise, g², of the sizes (n, axes)."""
    finite = np.isfinite(name.errors)
    errors = np.where(finite, name.errors, 0.0)
    weight = name.weights / max(float(name.weights.sum()), 1e-300)
    return weight[:, None], errors, np.where(finite, name.sizes**2 - errors**2, 0.0)


def size_of(name: Name) -> tuple[float, float, float]:
    """Rms size over levels and axes, and the ends of its 95 % interval, g."""
    weight, errors, squares = _squares(name)
    each = weight / 3.0
    mean = float((each * squares).sum())
    spread = 2.0 * float(np.sqrt((each**2 * (4.0 * name.sizes**2 * errors**2 + 2.0 * errors**4)).sum()))
    return tuple(float(np.sqrt(max(value, 0.0))) for value in (mean, mean - spread, mean + spread))  # type: ignore[return-value]


def levels_of(name: Name) -> list[DiscoveredLevel]:
    """The levels on the axis with the largest differences, in order of size."""
    axis = int(np.argmax(by_axis(name)))
    order = np.argsort(-np.abs(name.sizes[:, axis]))[:_SHOWN_LEVELS]
    return [
        {
            "level": name.labels[at],
            "size_ug": MICRO * float(name.sizes[at, axis]),
            "u_ug": MICRO * float(name.errors[at, axis]),
            "units": int(name.weights[at]),
        }
        for at in order
        if np.isfinite(name.errors[at, axis])
    ]


def station_sizes(station: Any, at: int) -> dict[str, tuple[float, float]]:
    """Size of a column at each station, and its standard error at the stated noise, g, by station."""
    table = station.levels[STATION]
    out: dict[str, tuple[float, float]] = {}
    for label, row in table.place.items():
        information = max(float(table.information[row, at]), 1e-300)
        out[label] = float(table.score[row, at] / information), float(1.0 / np.sqrt(information))
    return out


def without_largest(carried: Array) -> float:
    """Log evidence of the lots' contributions without the largest two per cent."""
    rest = np.sort(carried)[: max(1, int(0.98 * carried.size))]
    sums = Sums.of(1, two_sided=False)
    rms = float(np.sqrt(np.mean(rest**2))) or 1.0
    for value in rest / rms:
        sums.add(np.array([value]))
    return float(sums.log_e[0])


def next_of(driver: str, scope: Scope) -> str:
    """The next action: a measurement, or a change of the model."""
    if scope == "sensor_or_station":
        return (
            "measure some of the same units on another station: an effect that stays with the units is of the sensors"
        )
    if driver == SLOT:
        return "exchange units between slots, or check the fixture at this slot"
    if driver == STATION:
        return "measure the same units on two of these stations, and check their references"
    return "add the effect to the model of the next lots: 'tumbleline extend', then 'tumbleline discover --model'"


_KINDS = {"levels": "differs by", "slope": "changes with"}
_SCOPES = {
    "sensor": "of the sensors",
    "station": "of the station",
    "sensor_or_station": "of the sensors or the station",
    "thermometer": "of the thermometer",
}


def headline(row: DiscoveryRow) -> str:
    """Effects, driver, size and first night of a discovery in one line."""
    effects = " or ".join(row["effects"][:3]) + (" or …" if len(row["effects"]) > 3 else "")
    what = "is common to all lots" if row["kind"] == "mean" else f"{_KINDS[row['kind']]} {' or '.join(row['drivers'])}"
    low, high = row["interval_ug"]
    axes = f" on {', '.join(row['axes'])}" if row["axes"] and len(row["axes"]) < 3 else ""
    floors = row["size_floors"]
    share = "" if floors is None else f", {short(100.0 * floors, 2)} % of the noise of a dwell"
    size = f"{short(row['size_ug'])} µg rms (95 %: {short(low)} to {short(high)}){share}"
    return f"{row['id']}  {effects} {what}{axes}: {size}; found on {row['since']}, with lot {row['lots_then']}"


def scope_text(row: DiscoveryRow) -> str:
    """Scope of a discovery and its reason, with the level that differs most."""
    text = f"{_SCOPES[row['scope']]}: {row['because']}"
    if row["kind"] == "levels" and row["levels"]:
        top = row["levels"][0]
        text += f"; largest {top['level']} {_signed(top['size_ug'])} ± {short(2.0 * top['u_ug'])} µg"
    return text


def unexplained_text(row: UnexplainedRow) -> str:
    """A sentence on a dependence on a driver that no effect of the catalogue explains."""
    what = "a function of the pose" if row["map"] else "something"
    most = f", most in {row['level']}" if row["level"] else ""
    how = "is common to all lots" if row["driver"] == MEAN else f"differs by {row['driver']}{most}"
    text = f"{row['id']}  unexplained: {what} {how}, and no effect of the catalogue explains it"
    if row["map"]:
        size, error = np.array(row["map"])[:, 2:].T
        largest = int(np.argmax(np.abs(size)))
        value = f"{short(abs(float(size[largest])))} ± {short(2.0 * float(error[largest]))} µg"
        text += f"; up to {value} in axis {row['axes'][0]}"
    return f"{text}; found on {row['since']}, with lot {row['lots_then']}"


def _signed(value: float) -> str:
    return f"{'+' if value >= 0 else '−'}{short(abs(value))}" if math.isfinite(value) else "–"
