"""Numbers of the stations of this computer: those that a run drives, those not left safe, and events of their watchdogs."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from stations.safety.folder import read_log
from stations.safety.lease_files import read_holder


@dataclass
class StationNumbers:
    """Numbers from the state folder.

    driven : stations with a live run · unsafe : stations without a live run and not reported safe, with the last run
    events : number of events in the log, by station and event
    """

    driven: set[str] = field(default_factory=set[str])
    unsafe: dict[str, str] = field(default_factory=dict[str, str])
    events: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])


def read_stations(folder: Path) -> StationNumbers:
    """The numbers of the stations whose leases are in a folder."""
    numbers = StationNumbers()
    for path in sorted((folder / "leases").glob("*.json")):
        holder = read_holder(path)
        if holder is None:
            continue
        if holder.lives(path) and holder.role == "run" and not holder.tripped:
            numbers.driven.add(holder.station)
        else:
            numbers.unsafe[holder.station] = f"{holder.run} (process {holder.pid} on {holder.host})"
    for line in read_log(folder):
        numbers.events[str(line.get("station", "")), str(line.get("event", ""))] += 1
    return numbers
