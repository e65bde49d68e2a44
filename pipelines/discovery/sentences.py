"""Discoveries in sentences, for the screen, the page, the workbench and the alerts."""

import numpy as np

from inertial.discovery.evidence import MEAN
from inertial.uncertainty.rounding import short
from pipelines.discovery.documents import DiscoveryRow, UnexplainedRow

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
        sign = "+" if top["size_ug"] >= 0 else "−"
        axis = f" on {top['axis']}" if top["axis"] else ""
        text += f"; largest {top['level']}{axis} {sign}{short(abs(top['size_ug']))} ± {short(2.0 * top['u_ug'])} µg"
    return text


def texts_of(row: DiscoveryRow | UnexplainedRow) -> list[str]:
    """All sentences on a discovery or an unexplained dependence."""
    return [unexplained_text(row)] if "nearest" in row else [headline(row), scope_text(row), *support_text(row)]


def support_text(row: DiscoveryRow) -> list[str]:
    """How many lots carry a discovery, and whether later ones confirm it; nothing for errors of the references."""
    carried = row["carried_by"]
    if carried["lots_for"] is None:
        return []
    less = short(carried["log_e_without_largest_2_percent"])
    confirmed = "not confirmed yet: fewer than 20 lots were measured since it was found"
    if row["confirmed"] is not None:
        told = "show" if row["confirmed"] else "do not show"
        confirmed = f"the lots since it was found {told} what the earlier ones predict"
    share = short(100.0 * carried["lots_for"])
    return [f"{share} % of the lots speak for it; e^{less} without the 2 % that speak most", confirmed]


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
