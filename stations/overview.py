"""State of a station at one instant: angles, temperatures, states, devices in the slots, and the holder of the lease."""

from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from schemas.errors import StationError
from schemas.lot import Lot
from schemas.station import StationConfig
from stations.safety.folder import state_folder
from stations.safety.leases import holders
from stations.safety.safety_status import unsafe_reason
from stations.station import Station


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
    """A block with a function that reads the state of the station at each call; nothing moves, and no lease is needed.

    lot : the units in a simulated station; hardware reports its own
    """
    from stations.opening import make_plant, open_devices, serve_plant  # noqa: PLC0415 - imported only when the state is read

    if config.kind == "simulated":
        with serve_plant(config, lot, make_plant(config, lot)) as station:
            yield lambda: look_at(config, station)
        return
    slots: list[int] = []
    with (
        open_devices(config, ()) as empty,
        suppress(StationError),
    ):  # that the reader does not answer is shown by the state
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
