"""A simulated station served alone, in wall time, for any Modbus client; and a look at every register of a station."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.errors import StationError, WrongUse
from stations.codec import decode, named
from stations.links.modbus import ModbusLink
from stations.profile_files import load_profile

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from threading import Event

    from schemas.profile import Register
    from schemas.recipe import Lot
    from schemas.station import StationConfig
    from stations.codec import Value
    from stations.links.link import Link

TICK_S = 0.05
OCCUPIED = "occupied"


@dataclass(frozen=True)
class Served:
    """Where a device of a station answers, and by which profile."""

    name: str
    device_id: int
    profile: str
    host: str = ""
    port: int = 0


@dataclass(frozen=True)
class Reading:
    """One register as it reads now; ``fault`` says why it does not."""

    device: str
    device_id: int
    register: str
    address: int
    value: str
    unit: str
    fault: str = ""


def served(config: StationConfig, slots: list[int]) -> list[Served]:
    """Every device of a station, the slots of these numbers among them."""
    devices = config.devices
    named_devices = (
        ("outer axis", devices.outer),
        ("inner axis", devices.inner),
        ("chamber", devices.chamber),
        ("reader", devices.reader),
    )
    found = [Served(name, d.device_id, d.profile, d.host, d.port) for name, d in named_devices]
    s = devices.slots
    return found + [Served(f"slot {i}", s.device_id + i, s.profile, s.host, s.port) for i in slots]


def serve(
    config: StationConfig,
    lot: Lot,
    *,
    host: str,
    port: int,
    speed: float,
    stop: Event,
    ready: Callable[[str, int], None],
) -> None:
    """Comes back when ``stop`` is set; until then the station's time goes on at ``speed`` times the wall's.

    ``ready`` is told host and port once they listen. Nothing is sampled unless a client starts it.
    """
    if config.kind != "simulated":
        message = f"station {config.name}: kind {config.kind}, only a simulated station can be served; give such a file"
        raise WrongUse(message)
    from stations.clock import WallClock  # noqa: PLC0415 - only serving needs these
    from stations.opening import make_plant  # noqa: PLC0415
    from stations.plant.server import PlantServer  # noqa: PLC0415

    plant = make_plant(config, lot)
    with PlantServer(plant, host, port) as server:
        ready(server.host, server.port)
        clock, done = WallClock(), 0.0
        while not stop.wait(TICK_S):
            now = clock.now()
            plant.advance(round((now - done) * speed * 1e6))
            done = now


def look(config: StationConfig, lot: Lot | None) -> list[Reading]:
    """Every readable register of every device as it reads now; slots are those that the reader calls occupied.

    ``lot`` is what sits in a simulated station; hardware has what it has.
    """
    if config.kind == "simulated":
        if lot is None:
            message = f"station {config.name}: simulated, it needs a lot of units to look at; give one"
            raise WrongUse(message)
        from stations.opening import make_plant  # noqa: PLC0415 - hardware needs no plant
        from stations.plant.server import PlantServer  # noqa: PLC0415

        with PlantServer(make_plant(config, lot)) as server:
            return list(_look(config, (server.host, server.port)))
    return list(_look(config, None))


def _look(config: StationConfig, address: tuple[str, int] | None) -> Iterator[Reading]:
    slots: list[int] = []
    for device in served(config, []):
        link = _link(config, address or (device.host, device.port))
        try:
            for reading in _registers(link, device):
                if device.name == "reader" and reading.register == OCCUPIED and not reading.fault:
                    mask = int(float(reading.value))
                    slots = [i for i in range(mask.bit_length()) if mask >> i & 1]
                yield reading
        finally:
            link.close()
    for device in served(config, slots)[4:]:
        link = _link(config, address or (device.host, device.port))
        try:
            yield from _registers(link, device)
        finally:
            link.close()


def _link(config: StationConfig, address: tuple[str, int]) -> ModbusLink:
    return ModbusLink(*address, timeout_s=config.link.timeout_s, read_attempts=1)


def _registers(link: Link, device: Served) -> Iterator[Reading]:
    """The readable registers of one device; after the first that stays silent the others are not asked."""
    profile = load_profile(device.profile)
    for register in profile.registers:
        if register.access == "write":
            continue
        try:
            words = link.read(device.device_id, register.address, register.words, f"{device.name} {register.name}")
        except StationError as problem:
            yield _reading(device, register, "", str(problem))
            return
        yield _reading(device, register, _shown(register, decode(register, profile.order(register), words)), "")


def _reading(device: Served, register: Register, value: str, fault: str) -> Reading:
    return Reading(device.name, device.device_id, register.name, register.address, value, register.unit, fault)


def _shown(register: Register, value: Value) -> str:
    if isinstance(value, list):
        return ", ".join(f"{one:.6g}" for one in value)
    if isinstance(value, str):
        return value
    return named(register, value) if register.enumeration else f"{value:.9g}"
