"""A simulated station served alone, in wall time, for any Modbus client; and a look at every register of a station."""

from __future__ import annotations

import socket
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from schemas.errors import StationError, WrongUse
from stations.codec import named
from stations.devices.commands import Commands
from stations.devices.registers import Registers
from stations.links.making import Links
from stations.profile_files import profile_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from threading import Event

    from schemas.profile import Register
    from schemas.recipe import Lot
    from schemas.station import StationConfig
    from stations.codec import Value

TICK_S = 0.05
TRIES = 50
OCCUPIED = "occupied"
NAMES = (("outer axis", "outer"), ("inner axis", "inner"), ("chamber", "chamber"), ("reader", "reader"))


@dataclass(frozen=True)
class Served:
    """Where a device of a station answers, and by which profile; ``place`` is what the station's file calls it."""

    name: str
    place: str
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
    found = [
        Served(name, place, device.device_id, device.profile, device.host, device.port)
        for name, place in NAMES
        if (device := getattr(devices, place))
    ]
    s = devices.slots
    return found + [Served(f"slot {i}", "slots", s.device_id + i, s.profile, s.host, s.port) for i in slots]


def serve(
    config: StationConfig,
    lot: Lot,
    *,
    host: str,
    port: int,
    speed: float,
    stop: Event,
    ready: Callable[[str, int], None],
    silence_s: float = 0.0,
) -> None:
    """Comes back when ``stop`` is set; until then the station's time goes on at ``speed`` times the wall's.

    Drives and reader have watchdogs of their own: ``silence_s`` after the last request they stop; 0 never.
    ``ready`` gets host and port once they listen; a device with a text protocol has the next port. Nothing is sampled
    unless a client starts it.
    """
    if config.kind != "simulated":
        raise WrongUse(
            f"station {config.name}: kind {config.kind}, only a simulated station can be served; give such a file"
        )
    from stations.clock import WallClock  # noqa: PLC0415 - only serving needs these
    from stations.opening import make_plant  # noqa: PLC0415
    from stations.plant.line_server import LineServer  # noqa: PLC0415
    from stations.plant.server import PlantServer  # noqa: PLC0415
    from stations.plant.silence import IdleStop  # noqa: PLC0415

    plant = make_plant(config, lot)
    silence = IdleStop(plant, config.devices, silence_s)
    with ExitStack() as stack:
        begin = _with_room_behind(host) if plant.line_devices and port == 0 else port
        server = stack.enter_context(PlantServer(plant, host, begin))
        for number, device_id in enumerate(plant.line_devices, server.port + 1):
            stack.enter_context(LineServer(plant, device_id, host, number))
        ready(server.host, server.port)
        clock, done = WallClock(), 0.0
        while not stop.wait(TICK_S):
            now = clock.now()
            plant.advance(round((now - done) * speed * 1e6))
            silence.look(now)
            done = now


def _with_room_behind(host: str) -> int:
    """A free port whose next one is free too; 0, which is any, where there is none to be found."""
    for _ in range(TRIES):
        with socket.create_server((host, 0)) as first:
            port = int(first.getsockname()[1])
            with suppress(OSError, OverflowError), socket.create_server((host, port + 1)):
                return port
    return 0


def look(config: StationConfig, lot: Lot | None) -> list[Reading]:
    """Every readable register of every device as it reads now; slots are those that the reader calls occupied.

    ``lot`` is what sits in a simulated station; hardware has what it has.
    """
    once = config.model_copy(update={"link": config.link.model_copy(update={"read_attempts": 1})})
    if config.kind == "simulated":
        if lot is None:
            raise WrongUse(f"station {config.name}: simulated, it needs a lot of units to look at; give one")
        from stations.opening import make_plant, serve_devices  # noqa: PLC0415 - hardware needs no plant

        with serve_devices(once, make_plant(config, lot)) as links:
            return list(_look(once, links))
    links = Links(once)
    try:
        return list(_look(once, links))
    finally:
        links.close()


def _look(config: StationConfig, links: Links) -> Iterator[Reading]:
    slots: list[int] = []
    for device in served(config, []):
        for reading in _values(links, device):
            if device.name == "reader" and reading.register == OCCUPIED and not reading.fault:
                mask = int(float(reading.value))
                slots = [i for i in range(mask.bit_length()) if mask >> i & 1]
            yield reading
    for device in served(config, slots)[len(NAMES) :]:
        yield from _values(links, device)


def _values(links: Links, device: Served) -> Iterator[Reading]:
    """What one device tells; after the first question that it leaves unanswered the others are not asked."""
    profile = profile_of(getattr(links.config.devices, device.place))
    if profile.commands:
        commands = Commands(device.name, links.lines(device.place), profile)
        for number, command in enumerate(profile.commands):
            try:
                value = commands.text(command.name)
            except StationError as problem:
                yield Reading(device.name, device.device_id, command.name, number, "", command.unit, str(problem))
                return
            yield Reading(device.name, device.device_id, command.name, number, value, command.unit)
        return
    registers = Registers(device.name, links.registers(device.place), device.device_id, profile)
    for register in profile.registers:
        if register.access == "write":
            continue
        try:
            value = registers.read(register.name)
        except StationError as problem:
            yield _reading(device, register, "", str(problem))
            return
        yield _reading(device, register, _shown(register, value), "")


def _reading(device: Served, register: Register, value: str, fault: str) -> Reading:
    return Reading(device.name, device.device_id, register.name, register.address, value, register.unit, fault)


def _shown(register: Register, value: Value) -> str:
    if isinstance(value, list):
        return ", ".join(f"{one:.6g}" for one in value)
    if isinstance(value, str):
        return value
    return named(register, value) if register.enumeration else f"{value:.9g}"
