"""Serves a simulated station in wall time to any Modbus client, and reads every register of a station."""

import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from functools import partial
from threading import Event
from typing import TYPE_CHECKING, Annotated

from schemas.errors import StationError, StationRefused, WrongUse
from schemas.lot import Lot
from schemas.profile import Command, Register
from schemas.station import StationConfig
from schemas.station_devices import Devices
from stations.codec import named
from stations.devices.commands import Commands
from stations.devices.registers import Registers
from stations.links.making import Links
from stations.profile_files import profile_of

if TYPE_CHECKING:
    from stations.plant.plant import Plant
    from stations.plant.server import PlantServer

TICK_S = 0.05  # of the station's time, by which what a client reads is late
SHORTEST_TICK_S = 0.001
TRIES = 50
OCCUPIED = "occupied"
NAMES = (("outer axis", "outer"), ("inner axis", "inner"), ("chamber", "chamber"), ("reader", "reader"))


@dataclass(frozen=True)
class Served:
    """Address and profile of a device of a station; ``key`` is its name in the station file."""

    name: str
    key: str
    device_id: int
    profile: str
    host: str = ""
    port: int = 0


@dataclass(frozen=True)
class RegisterReading:
    """Present value of one register."""

    device: str
    device_id: int
    register: str
    address: int
    value: str
    unit: str
    fault: Annotated[str, "reason why it cannot be read; empty otherwise"] = ""


def served(config: StationConfig, slots: list[int]) -> list[Served]:
    """Every device of a station, with the slots of these numbers."""
    devices = config.devices
    shared = [
        Served(name, key, device.device_id, device.profile, device.host, device.port)
        for name, key in NAMES
        if (device := getattr(devices, key))
    ]
    s = devices.slots
    return shared + [Served(f"slot {i}", "slots", s.device_id + i, s.profile, s.host, s.port) for i in slots]


def serve(
    config: StationConfig,
    lot: Lot,
    *,
    host: str,
    port: int,
    speed: float,
    stop: Event,
    ready: "Callable[[str, int], Callable[[Plant], None] | None]",
    silence_s: float = 0.0,
) -> None:
    """Serves until ``stop`` is set; the time of the station advances at ``speed`` times wall time.

    Drives and reader have communication time-outs: they stop ``silence_s`` after the last request; 0 means never.
    ``ready`` gets host and port once they listen; a device with a text protocol has the next port. What it returns is called
    with the plant at every tick. Sampling starts only on the command of a client.
    """
    if config.kind != "simulated":
        raise WrongUse(
            f"station {config.name}: kind {config.kind}, a simulated station is needed; give the file of one"
        )
    from stations.clock import WallClock  # noqa: PLC0415 - only the server needs these modules
    from stations.opening import make_plant  # noqa: PLC0415

    plant = make_plant(config, lot)
    silence = IdleStop(plant, config.devices, silence_s)
    with ExitStack() as stack:
        server = _listening(plant, host, port, stack)
        each_tick = ready(server.host, server.port)
        clock, done = WallClock(), 0.0
        while not stop.wait(max(SHORTEST_TICK_S, min(TICK_S, TICK_S / speed))):
            now = clock.now()
            plant.advance(round((now - done) * speed * 1e6))
            silence.look(now)
            if each_tick is not None:
                each_tick(plant)
            done = now


def _listening(plant: "Plant", host: str, port: int, stack: ExitStack) -> "PlantServer":
    """The servers of all devices, left to ``stack``; with port 0 another port is tried when a program has just taken one."""
    from stations.plant.server import PlantServer, serve_lines  # noqa: PLC0415

    for attempt in range(TRIES):
        with ExitStack() as servers:
            begin = _free_port_pair(host) if plant.line_devices and port == 0 else port
            try:
                server = servers.enter_context(PlantServer(plant, host, begin))
                for number, device_id in enumerate(plant.line_devices, server.port + 1):
                    servers.enter_context(serve_lines(plant, device_id, host, number))
            except (StationRefused, OverflowError) as problem:  # there is no port above 65535
                if port == 0 and attempt < TRIES - 1:
                    continue
                last = begin + len(plant.line_devices)
                ports = (
                    f"port {begin}"
                    if last == begin
                    else f"ports {begin} (registers) to {last} (one for each text protocol)"
                )
                found = str(problem).partition(",")[0].rstrip(".")
                raise StationRefused(f"{found}, free {ports} are needed; give another --port, or 0 for any") from None
            stack.enter_context(servers.pop_all())
            return server
    raise StationRefused(f"simulated station: {host} has no free port, one is needed; end other programs")


def _free_port_pair(host: str) -> int:
    """A free port with a free next port; 0, which means any port, where the search finds none."""
    for _ in range(TRIES):
        with socket.create_server((host, 0)) as first:
            port = int(first.getsockname()[1])
            with suppress(OSError, OverflowError), socket.create_server((host, port + 1)):
                return port
    return 0


def look(config: StationConfig, lot: Lot | None) -> list[RegisterReading]:
    """Present value of every readable register of every device, with the slots that the reader reports as occupied.

    ``lot`` has the units of a simulated station; hardware needs none.
    """
    once = config.model_copy(update={"link": config.link.model_copy(update={"read_attempts": 1})})
    if config.kind == "simulated":
        if lot is None:
            raise WrongUse(f"station {config.name}: simulated without units, a lot is needed; give one")
        from stations.opening import make_plant, serve_devices  # noqa: PLC0415 - hardware needs no plant

        with serve_devices(once, make_plant(config, lot)) as links:
            return list(_look(once, links))
    with closing(Links(once)) as links:
        return list(_look(once, links))


def _look(config: StationConfig, links: Links) -> Iterator[RegisterReading]:
    slots: list[int] = []
    for device in served(config, []):
        for reading in _values(links, device):
            if device.name == "reader" and reading.register == OCCUPIED and not reading.fault:
                mask = int(float(reading.value))
                slots = [i for i in range(mask.bit_length()) if mask >> i & 1]
            yield reading
    for device in served(config, slots)[len(NAMES) :]:
        yield from _values(links, device)


def _values(links: Links, device: Served) -> Iterator[RegisterReading]:
    """Values of one device; after the first request without an answer its other registers are not read."""
    profile = profile_of(getattr(links.config.devices, device.key))
    asked: list[tuple[Register | Command, int, Callable[[], str]]]
    if profile.commands:
        commands = Commands(device.name, links.lines(device.key), profile)
        asked = [(c, number, partial(commands.text, c.name)) for number, c in enumerate(profile.commands)]
    else:
        registers = Registers(device.name, links.registers(device.key), device.device_id, profile)
        readable = [r for r in profile.registers if r.access != "write"]
        asked = [(r, r.address, partial(_shown, registers, r)) for r in readable]
    for entry, address, read in asked:
        try:
            value, fault = read(), ""
        except StationError as problem:
            value, fault = "", str(problem)
        yield RegisterReading(device.name, device.device_id, entry.name, address, value, entry.unit, fault)
        if fault:
            return


def _shown(registers: Registers, register: Register) -> str:
    value = registers.read(register.name)
    if isinstance(value, list):
        return ", ".join(f"{number:.6g}" for number in value)
    if isinstance(value, str):
        return value
    return named(register, value) if register.enumeration else f"{value:.9g}"


class IdleStop:
    """Stops devices without a request for ``seconds``; the time counts from the first request to a device."""

    def __init__(self, plant: "Plant", devices: Devices, seconds: float) -> None:
        self._plant, self._seconds = plant, seconds
        self._stops: dict[int, Callable[[], None]] = {
            devices.outer.device_id: lambda: plant.outer.halt(plant.now),
            devices.inner.device_id: lambda: plant.inner.halt(plant.now),
            devices.reader.device_id: plant.sampler.stop,
        }
        self._last_request: dict[int, float] = {}

    def look(self, now: float) -> None:
        """Updates the time of the last request of each device at ``now`` s wall time, and stops devices after the time-out."""
        if self._seconds == 0.0:
            return
        with self._plant.lock:
            self._last_request.update(dict.fromkeys(self._plant.requested & self._stops.keys(), now))
            self._plant.requested.clear()
            late = [device_id for device_id, last in self._last_request.items() if now - last > self._seconds]
            for device_id in late:
                self._stops[device_id]()
                del self._last_request[device_id]
