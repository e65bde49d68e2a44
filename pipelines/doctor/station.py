"""Check of a station without a lease: its devices answer, no run drives it, and it was left safe. Nothing is moved."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.doctor.check import Check, of_error
from schemas.errors import TumblelineError

if TYPE_CHECKING:
    from pathlib import Path

    from stations.overview import Overview

PART = "station"


def station_checks(path: Path | None) -> list[Check]:
    """The checks of a station's file and, if it is of hardware, of its devices."""
    from schemas.lot import Lot
    from schemas.station import load_station
    from stations.overview import looked_at

    if path is None:
        return [Check(PART, "file", "not configured", "no station is named", "", "name its file with --station")]
    try:
        config = load_station(path)
    except TumblelineError as problem:
        return [of_error(PART, "file", problem)]
    out = [Check(PART, "file", "good", f"{config.name} ({config.kind})")]
    if config.kind == "simulated":
        return [*out, Check(PART, "devices", "good", "simulated in the process of each run")]
    try:
        with looked_at(config, Lot.model_construct(units=[])) as look:
            now = look()
    except TumblelineError as problem:
        return [*out, of_error(PART, "devices", problem)]
    return [*out, *_seen(now)]


def _seen(now: Overview) -> list[Check]:
    out = [_fault(part, text) for part, text in now.faults.items()]
    if not out:
        angles = ", ".join(f"{name} {angle:.3f}°" for name, angle in now.angles_deg.items())
        slots = f"{len(now.slots)} slots with a unit"
        out.append(Check(PART, "devices", "good", f"{angles}, chamber {now.chamber_C:.2f} °C, {slots}"))
    out.append(_lease(now))
    for name, found, good in (("door", now.door, "closed"), ("emergency stop", now.emergency_stop, "released")):
        if found and found != good:
            out.append(Check(PART, name, "warning", found, good, "put it right at the station before the next run"))
    return out


def _fault(part: str, text: str) -> Check:
    found, _, remedy = text.rpartition("; ")
    return Check(PART, part, "fault", found or text, "", remedy if found else "check its power, cable and address")


def _lease(now: Overview) -> Check:
    if now.lease is None:
        return Check(PART, "lease", "good", "free")
    holder = now.lease
    found = f"driven by {holder['run']}, process {holder['pid']} on {holder['host']} since {holder['since']}"
    return Check(PART, "lease", "warning", found, "a free lease for the next run", "wait for its end")
