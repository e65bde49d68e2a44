"""``tumbleline station status``: angles, temperatures, states, slots and lease of a station, once or live."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import JsonOption, StationOption, option
from pipelines.cli.printing import console, print_json, remark, say
from pipelines.cli.station_lot import DeviceOption, UnitsOption, made_up
from schemas.errors import STATION

if TYPE_CHECKING:
    from rich.console import Group
    from rich.text import Text

    from stations.overview import Overview

GOOD, BAD = "green", "bold red"


def status(
    station: StationOption = None,
    device: DeviceOption = "ADXL355",
    units: UnitsOption = 8,
    every: Annotated[float, option("--every", "Seconds between two readings with --watch.", min=0.1)] = 1.0,
    *,
    watch: Annotated[bool, option("--watch", "Repeat until Ctrl-C.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show angles, temperatures, states, slots and the run that drives the station.

    Exit status 3: a part does not answer, or a run ended without the safe state.

    Nothing is moved and no lease is needed: a run in progress is not disturbed.
    """
    from schemas.station import load_station
    from stations.overview import looked_at

    config = load_station(station)
    with looked_at(config, made_up(device, units, 1)) as look:
        now = look()
        if as_json:
            print_json({"ok": not now.faults, **now.document()})
        elif watch:
            now = _live(look, every)
        else:
            say(picture(now))
    if not as_json:
        for fault in now.faults.values():
            remark(fault)
    raise typer.Exit(STATION if now.faults else 0)


def _live(look: Callable[[], Overview], every: float) -> Overview:
    """Show new readings until Ctrl-C; return the last one."""
    import time

    from rich.live import Live

    now = look()
    with Live(picture(now), console=console(), refresh_per_second=4, screen=False) as live:
        try:
            while True:
                time.sleep(every)
                now = look()
                live.update(picture(now))
        except KeyboardInterrupt:
            return now


def picture(now: Overview) -> Group:
    """The readings of a station as a table for the terminal."""
    from rich.console import Group
    from rich.table import Table

    parts = Table(box=None, show_header=False, pad_edge=False)
    for name in ("outer", "inner"):
        angle = now.angles_deg.get(name)
        parts.add_row(f"{name} axis", "—" if angle is None else f"{angle:9.3f}°", now.axes.get(name, ""))
    air = "—" if now.chamber_C is None else f"{now.chamber_C:9.2f} °C"
    goal = "" if now.set_point_C is None else f"{now.chamber}, set point {now.set_point_C:g} °C"
    parts.add_row("chamber", air, goal)
    shaken = "—" if now.vibration_g is None else f"{now.vibration_g * 1e6:9.1f} µg"
    parts.add_row("vibration", shaken, "")
    parts.add_row("door", "", _word(now.door, "closed"))
    parts.add_row("emergency stop", "", _word(now.emergency_stop, "released"))
    parts.add_row("sampling", "", now.sampling)
    parts.add_row("driven by", "", driven_by(now))
    slots = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in ("slot", "unit", "°C", "V"):
        slots.add_column(heading, justify="left" if heading == "unit" else "right")
    for slot in now.slots:
        slots.add_row(str(slot.slot), slot.serial or "—", f"{slot.unit_C:.2f}", f"{slot.supply_V:.4f}")
    return Group(f"{now.station} ({now.kind})", parts, "", slots)


def driven_by(now: Overview) -> str:
    """The run that drives a station, as text."""
    if now.kind == "simulated":
        return "no shared station: every run simulates its own"
    if now.lease is None:
        return "no run"
    lease = now.lease
    process = f"{lease['run']}, process {lease['pid']} on {lease['host']} since {lease['since']}"
    who = f"{process}, last sign of life {lease['heard_s']:g} s ago"
    return f"the watchdog of {who}" if lease["role"] == "watchdog" else who


def _word(state: str, good: str) -> Text:
    from rich.text import Text

    return Text(state or "—", style=GOOD if state == good else BAD)
