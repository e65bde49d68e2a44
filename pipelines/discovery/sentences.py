"""A discovery in sentences, the same on screen, page and alert."""

from __future__ import annotations

import math

from inertial.uncertainty.rounding import short
from pipelines.discovery.documents import DiscoveryRow

_KINDS = {"levels": "differs by", "slope": "changes with"}
_SCOPES = {
    "sensor": "of the sensors",
    "station": "of the station",
    "sensor_or_station": "of the sensors or the station",
    "thermometer": "of the thermometer",
}


def headline(row: DiscoveryRow) -> str:
    """What, by what, how large, since when."""
    effects = " | ".join(row["effects"][:3]) + (" | …" if len(row["effects"]) > 3 else "")
    what = "is common to all lots" if row["kind"] == "mean" else f"{_KINDS[row['kind']]} {' | '.join(row['drivers'])}"
    low, high = row["interval_ug"]
    axes = f" on {', '.join(row['axes'])}" if row["axes"] and len(row["axes"]) < 3 else ""
    size = (
        f"rms {short(row['size_ug'])} µg [{short(low)}, {short(high)}], {short(row['size_floors'])} of a dwell's noise"
    )
    return f"{row['id']}  {effects} {what}{axes}: {size}; since {row['since']} (lot {row['lots_then']})"


def scope_text(row: DiscoveryRow) -> str:
    """Whose it is and why that is said, with the level that differs most."""
    text = f"{_SCOPES[row['scope']]}: {row['because']}"
    if row["kind"] == "levels" and row["levels"]:
        top = row["levels"][0]
        text += f"; largest {top['level']} {_signed(top['size_ug'])} ± {short(2.0 * top['u_ug'])} µg"
    return text


def _signed(value: float) -> str:
    return f"{'+' if value >= 0 else '−'}{short(abs(value))}" if math.isfinite(value) else "–"
