"""``tumbleline station status`` and ``watch``: readings of a station, and temperatures and angles over time in the terminal."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from pipelines.archive import Archive, Records
from pipelines.cli import options
from pipelines.cli.chart import Line, chart, clock
from pipelines.cli.inputs import made_up
from pipelines.cli.options import argument, option
from pipelines.cli.printing import console, print_json, remark, say
from schemas.errors import STATION, WrongUse

if TYPE_CHECKING:
    from rich.console import Group
    from rich.text import Text

    from stations.overview import Overview


GOOD, BAD = "green", "bold red"


def status(
    station: options.StationOption = None,
    device: options.SimulatedDeviceOption = "ADXL355",
    units: options.SimulatedUnitsOption = 8,
    every: Annotated[
        float, option("--every S", "Read again after so many seconds, until Ctrl-C; 0: once.", min=0.0)
    ] = 0.0,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show angles, temperatures, states, slots and the run that drives the station.

    Exit status 3: a part does not answer, or a run ended without the safe state.

    Nothing is moved: a run in progress is not disturbed.
    """
    from schemas.station import load_station
    from stations.overview import looked_at

    config = load_station(station)
    with looked_at(config, made_up(device, units, 1)) as look:
        now = look()
        if as_json:
            print_json({"ok": not now.faults, **now.document()})
        elif every:
            now = _live(look, overview, every)
        else:
            say(overview(now))
    if not as_json:
        for fault in now.faults.values():
            remark(fault)
    raise typer.Exit(STATION if now.faults else 0)


def overview(now: Overview) -> Group:
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


MOVE_S = 5.0  # the table keeps its position until shortly before the next record
Points = list[tuple[float, float]]
Seen = TypeVar("Seen")
Look = Callable[[], "ChartData"]


SERIES = ("chamber", "coldest", "warmest", "outer", "inner")


@dataclass
class ChartData:
    """Data of the charts: temperatures in °C and angles in degrees against the time of the station, s, by name."""

    title: str
    over: bool = False
    points: dict[str, Points] = field(default_factory=lambda: {name: [] for name in SERIES})

    @property
    def last(self) -> float:
        """The newest time of the data."""
        return max((points[-1][0] for points in self.points.values() if points), default=0.0)

    def document(self) -> dict[str, Any]:
        """The same for JSON."""
        return {"title": self.title, "over": self.over, **self.points}


def watch(
    run: Annotated[str, argument("[RUN]", "A run of the archive; default: the newest.")] = "latest",
    station: options.StationOption = None,
    archive: options.ArchiveOption = None,
    minutes: Annotated[
        float, option("--last N", "Number of minutes before now; default: the whole run.", min=0.1)
    ] = math.inf,
    every: Annotated[float, option("--every S", "Seconds between two readings; 0: draw once and exit.", min=0.0)] = 1.0,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Draw temperatures and angles over time, live: of a run in the archive, or with --station of a station."""
    with _source(run, station, archive) as look:
        if as_json:
            print_json(look().document())
        elif not every or not sys.stdout.isatty():
            say(picture(look(), minutes))
        else:
            _live(look, lambda seen: picture(seen, minutes), every, lambda seen: seen.over)


@contextmanager
def _source(run: str, station: Path | None, archive: str | None) -> Generator[Look]:
    if station is None:
        source = Archive(archive).run(run)
        records = source.records
        if records is None:
            raise WrongUse(f"run {source.id}: its data were imported, a captured run is needed; name a captured run")
        yield lambda: of_records(source.id, records)
        return
    from schemas.station import load_station
    from stations.overview import looked_at

    config = load_station(station)
    with looked_at(config, made_up("ADXL355", 8, 1)) as look:
        seen = ChartData(config.name)
        yield lambda: _added(seen, look())


def of_records(title: str, records: Records) -> ChartData:
    """Data of the charts from the records of a capture so far."""
    if not records.finished():
        return ChartData(title)
    history, readings = records.gathered("history"), records.gathered("readings")
    by_time = history.groupby("time_s").agg(air=("chamber_C", "first"), low=("unit_C", "min"), high=("unit_C", "max"))
    by_record = readings.drop_duplicates("record").sort_values("start_s")
    times = [float(t) for t in by_time.index]

    def series(name: str) -> Points:
        return list(zip(times, map(float, by_time[name]), strict=True))

    def stairs(name: str) -> Points:
        starts, values = list(map(float, by_record["start_s"])), list(map(float, by_record[name]))
        ends = [start - MOVE_S for start in starts[1:]] + [starts[-1] + float(by_record["duration_s"].iloc[-1])]
        return [(t, v) for start, end, v in zip(starts, ends, values, strict=True) for t in (start, max(start, end))]

    temperatures = {"chamber": series("air"), "coldest": series("low"), "warmest": series("high")}
    angles = {"outer": stairs("outer_deg"), "inner": stairs("inner_deg")}
    return ChartData(title, records.is_complete(), temperatures | angles)


def _added(seen: ChartData, now: Overview) -> ChartData:
    """The data with one more reading of the station."""
    time = now.time_s
    if now.chamber_C is not None:
        seen.points["chamber"].append((time, now.chamber_C))
    known = [slot.unit_C for slot in now.slots if slot.unit_C is not None and math.isfinite(slot.unit_C)]
    if known:
        seen.points["coldest"].append((time, min(known)))
        seen.points["warmest"].append((time, max(known)))
    for name, angle in now.angles_deg.items():
        seen.points[name].append((time, angle))
    return seen


def picture(seen: ChartData, minutes: float) -> Group:
    """Both charts, as wide and high as the terminal."""
    from rich.console import Group

    out = console()
    width, height = out.width, max(6, min(16, (out.height - 8) // 2))
    last = seen.last
    first = min((points[0][0] for points in seen.points.values() if points), default=0.0)
    span = (max(first, last - 60.0 * minutes), max(last, first + 1.0))
    temperatures = [
        Line("chamber", "cyan", seen.points["chamber"]),
        Line("coldest unit", "blue", seen.points["coldest"]),
        Line("warmest unit", "red", seen.points["warmest"]),
    ]
    angles = [Line("outer", "green", seen.points["outer"]), Line("inner", "magenta", seen.points["inner"])]
    state = "finished" if seen.over else f"at {clock(last)}"
    return Group(
        f"{seen.title}, {state}",
        chart("°C", temperatures, width, height, span),
        chart("deg", angles, width, height, span),
    )


def _live(
    look: Callable[[], Seen],
    draw: Callable[[Seen], Group],
    every: float,
    over: Callable[[Seen], bool] = lambda _: False,
) -> Seen:
    """Show new readings until the end of the run, or Ctrl-C; return the last one."""
    import time

    from rich.live import Live

    seen = look()
    with Live(draw(seen), console=console(), refresh_per_second=4) as live, suppress(KeyboardInterrupt):
        while not over(seen):
            time.sleep(every)
            seen = look()
            live.update(draw(seen))
    return seen
