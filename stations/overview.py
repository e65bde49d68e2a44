"""State of a station at one instant: angles, temperatures, slots, holder of the lease, and whether it was left safe."""

import fcntl
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from schemas.errors import StationError
from schemas.lot import Lot
from schemas.station import StationConfig
from stations.safety.folder import state_folder
from stations.safety.lease_files import Holder, addresses, lease_file, read_holder
from stations.safety.leases import holders
from stations.station import Station

AGAIN_S = 0.5


@dataclass
class SlotNow:
    """Present state of a slot."""

    slot: int
    serial: str
    unit_C: float | None
    supply_V: float | None


@dataclass
class Overview:
    """Present state of a station; ``faults`` has the error of each part that does not answer."""

    station: str
    kind: str
    time_s: float = 0.0
    angles_deg: dict[str, float] = field(default_factory=dict[str, float])
    axes: dict[str, str] = field(default_factory=dict[str, str])
    chamber_C: float | None = None
    set_point_C: float | None = None
    chamber: str = ""
    door: str = ""
    emergency_stop: str = ""
    vibration_g: float | None = None
    sampling: str = ""
    slots: list[SlotNow] = field(default_factory=list[SlotNow])
    lease: dict[str, Any] | None = None
    faults: dict[str, str] = field(default_factory=dict[str, str])

    def document(self) -> dict[str, Any]:
        """The JSON document of the state."""
        return asdict(self)


@contextmanager
def looked_at(config: StationConfig, lot: Lot) -> Generator[Callable[[], Overview]]:
    """A block with a function that reads the state of the station at each call, without any motion or lease.

    lot : the units in a simulated station; hardware reports its units
    """
    from stations.opening import make_plant, open_devices, serve_plant  # noqa: PLC0415 - imported only when the state is read

    if config.kind == "simulated":
        with serve_plant(config, lot, make_plant(config, lot)) as station:
            yield lambda: look_at(config, station)
        return
    slots: list[int] = []
    # a reader that does not answer is reported in the state
    with open_devices(config, ()) as empty, suppress(StationError):
        slots = empty.reader.occupied()
    with open_devices(config, slots) as station:
        yield lambda: look_at(config, station)


def look_at(config: StationConfig, station: Station) -> Overview:
    """The present state of the station; a part that does not answer is recorded in ``faults``, the others are shown."""
    now = Overview(config.name, config.kind, station.clock.now())
    parts = {"table": _table, "chamber": _chamber, "reader": _reader}
    for part, look in (parts if config.kind == "simulated" else {**parts, "lease": _lease}).items():
        try:
            look(now, station)
        except StationError as problem:
            now.faults[part] = str(problem)
    return now


def _table(now: Overview, station: Station) -> None:
    for name, axis in station.table.axes.items():
        state = axis.state()
        text = state.alarm or ("moving" if state.moving else "in position" if state.in_position else "standing")
        now.axes[name] = text if state.homed else f"{text}, not homed"
        now.angles_deg[name] = axis.position()


def _chamber(now: Overview, station: Station) -> None:
    now.chamber_C = station.chamber.temperature()
    now.set_point_C = station.chamber.set_point()
    now.chamber = station.chamber.mode()


def _reader(now: Overview, station: Station) -> None:
    reader = station.reader
    now.sampling = reader.sampling()
    instruments = reader.instruments()
    now.door = "open" if instruments.door_open else "closed"
    now.emergency_stop = "pressed" if instruments.stop_pressed else "released"
    now.vibration_g = instruments.vibration_g
    for number, slot in sorted(reader.slots.items()):
        try:
            serial = slot.identity().serial
        except StationError as problem:
            serial = ""
            now.faults[f"slot {number}"] = str(problem)
        temperature, supply = instruments.temperature_C[number], instruments.supply_V[number]
        now.slots.append(SlotNow(number, serial, temperature, supply))


def _lease(now: Overview, station: Station) -> None:
    """Holder of the lease, and the reason where a run has not left the station safe."""
    for holder, age in filter(None, holders(state_folder(), station.config).values()):
        keys = ("run", "pid", "host", "since", "role", "tripped")
        now.lease = {**{key: getattr(holder, key) for key in keys}, "heard_s": round(age, 1)}
        break
    if problem := unsafe_reason(state_folder(), station.config):
        now.faults["safe state"] = problem


def unsafe_reason(folder: Path, config: StationConfig) -> str:
    """The reason why the station does not count as safe; empty if it is safe, or if a live run drives it.

    A first finding is checked again, because a lease that is being taken or released has a lock and no note for a moment.
    """
    if _reason(folder, config):
        time.sleep(AGAIN_S)
    return _reason(folder, config)


def _reason(folder: Path, config: StationConfig) -> str:
    for address in addresses(config).values():
        path = lease_file(folder, address)
        holder, taken = read_holder(path), _is_locked(path.with_suffix(".lock"))
        text = _reason_of_lease(holder, path, address, taken=taken)
        if text:
            return f"station {config.name}: {text}"
    return ""


def _reason_of_lease(holder: Holder | None, path: Path, address: str, *, taken: bool) -> str:
    if holder is None:
        if not taken and not path.exists():
            return ""
        state = "is held by an unknown process" if taken else "cannot be read and is not held"
        return f"the lease on {address} {state} ({path}); check the station before the next run"
    who = f"{holder.run} (process {holder.pid} on {holder.host} since {holder.since})"
    if holder.lives(path):
        return _reason_of_live_holder(holder, who)
    if taken:
        return ""
    return (
        f"{who} has ended and neither it nor its watchdog has reported the station safe; check axes and chamber; the next "
        "run or 'station check' takes over the lease and leaves the station safe"
    )


def _reason_of_live_holder(holder: Holder, who: str) -> str:
    if holder.role == "watchdog":
        return (
            f"the watchdog of {who} is making the station safe and has not finished ({holder.trouble or 'it has just started'}); "
            "it continues until the station is safe; check the devices that it names"
        )
    if holder.tripped:
        return f"{who} does not respond; its watchdog has put the station into its safe state; end that process"
    if holder.trouble:
        return f"{who}: {holder.trouble}, which has not reported the station safe yet; wait a moment and check again"
    return ""


def _is_locked(path: Path) -> bool:
    """Whether a process holds a lease's lock; the test itself holds it shared for a moment."""
    try:
        with path.open("rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False
