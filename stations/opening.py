"""Opening a station from its links, profiles and adapters; the only module that distinguishes simulation from hardware."""

import fcntl
import os
import tempfile
from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from schemas.errors import RecipeInvalid, StationError
from schemas.lot import Lot
from schemas.profile import TEXT_CARRIERS, Carrier, Profile, limits_of
from schemas.station import Limits, StationConfig
from schemas.station_devices import Device
from stations.clock import Clock, WallClock
from stations.devices.adapters import adapter_of
from stations.devices.chamber import ThermalChamber
from stations.devices.commands import Commands, Values
from stations.devices.equipment import Equipment
from stations.devices.reader import Reader
from stations.devices.registers import Registers
from stations.devices.slot import Slot
from stations.devices.table import TableAxis, TiltTable
from stations.links.gate import Permit
from stations.links.making import Links
from stations.links.recorder import RecordedClock
from stations.plant.hidden import HiddenEffect
from stations.profile_files import profile_of
from stations.recordings.held import HeldClock, active_replay
from stations.safety.guarded import Protection, guarded
from stations.safety.safe_state import equipment_steps, safe_steps
from stations.station import Station, nobody_else

if TYPE_CHECKING:
    from stations.plant.plant import Plant

_NAME = "tumbleline-{user}-processor-{number}.lock"


@contextmanager
def open_station(
    config: StationConfig,
    lot: Lot,
    resume: bytes | None = None,
    *,
    hidden: Sequence[HiddenEffect] = (),
    run: str = "a run",
    roles: Sequence[str] = (),
) -> Generator[Station]:
    """A station ready to be driven; closed when the context ends.

    Hardware is leased and supervised by a watchdog during the context, and left in its safe state however the context ends.

    config : the station's file
    lot : the units in it; a simulated station simulates these devices
    resume : ``Station.state()`` of an earlier session, in which a simulated station continues; hardware keeps its present state
    hidden : physics beyond the station's file, for simulated stations
    run : purpose of the leases, for messages to other runs
    roles : equipment that the run needs besides table, chamber and reader
    """
    held = active_replay()
    if held is not None:
        slots, links = [unit.slot for unit in lot.units], Links(config, instead=held)
        yield _assemble(config, slots, links, HeldClock(held), roles)
        return
    if config.kind == "simulated":
        plant = make_plant(config, lot, resume, hidden)
        with serve_plant(config, lot, plant, roles) as station:
            yield station
        return
    slots = [unit.slot for unit in lot.units]
    with guarded(config, run) as protection, open_devices(config, slots, resume, protection, roles) as station:
        try:
            yield station
        except StationError:
            protection.leases.require()  # if the leases are lost, that is the reason to report, not the error it caused
            raise
        finally:
            protection.leave(station.make_safe)


@contextmanager
def open_devices(
    config: StationConfig,
    slots: Sequence[int],
    resume: bytes | None = None,
    protection: Protection | None = None,
    roles: Sequence[str] = (),
) -> Generator[Station]:
    """The devices of a hardware station; without ``protection`` only for reading their state or making them safe."""
    permit, require = None, nobody_else
    if protection is not None:
        permit = Permit(protection.leases.alive, protection.leases.require, config.link.timeout_s)
        require = protection.require
    clock = WallClock(resume, config.link.speed)
    with closing(Links(config, permit=permit)) as links:
        yield replace(_assemble(config, slots, links, clock, roles), state=clock.state, exact=False, require=require)


def make_plant(
    config: StationConfig, lot: Lot, resume: bytes | None = None, hidden: Sequence[HiddenEffect] = ()
) -> "Plant":
    """The plant of a simulated station, in the state ``resume`` if one is given."""
    from stations.plant.plant import Plant  # noqa: PLC0415 - hardware needs no plant

    plant = Plant(config, lot, hidden)
    if resume:
        plant.resume(resume)
    return plant


@contextmanager
def serve_plant(config: StationConfig, lot: Lot, plant: "Plant", roles: Sequence[str] = ()) -> Generator[Station]:
    """A station whose devices are those of a plant, served on loopback; ``lot``: the units that the client expects."""
    from stations.plant.plant import PlantClock  # noqa: PLC0415 - hardware needs no plant

    with serve_devices(config, plant, roles) as links:
        station = _assemble(config, [unit.slot for unit in lot.units], links, PlantClock(plant), roles)
        yield replace(station, state=lambda: plant.journal.state(plant.now_us))


@contextmanager
def serve_devices(config: StationConfig, plant: "Plant", roles: Sequence[str] = ()) -> Generator[Links]:
    """The links to a plant's devices, served on loopback: registers over Modbus TCP, lines beside it."""
    from stations.plant.faults.wire import on_the_wire  # noqa: PLC0415
    from stations.plant.server import LOOPBACK, PlantServer, serve_lines  # noqa: PLC0415

    with ExitStack() as stack:
        stack.enter_context(one_processor())
        server = stack.enter_context(PlantServer(plant))
        at: dict[Carrier, tuple[str, int]] = {
            "tcp": stack.enter_context(on_the_wire(plant, plant.faults, server.host, server.port))
        }
        lines_at: dict[int, tuple[str, int]] = {}
        wanted = {device.device_id for role, device in config.fitted().items() if role in roles}
        for device_id in plant.line_devices:
            if device_id in wanted or device_id == config.devices.chamber.device_id:
                lines_at[device_id] = at["ascii"] = (LOOPBACK, stack.enter_context(serve_lines(plant, device_id)))
        links = Links(config, at, lines_at=lines_at)
        stack.callback(links.close)
        yield links


def _assemble(
    config: StationConfig, slots: Sequence[int], links: Links, clock: Clock, roles: Sequence[str] = ()
) -> Station:
    """The station's adapters on their links, each with the intersection of its profile's and the station's limits."""
    if links.recorder is not None:
        clock = RecordedClock(clock, links.recorder)
    devices, limits = config.devices, config.limits
    axes = {
        "outer": _axis("outer", _registers("outer axis", "outer", devices.outer, links), limits.outer_deg, limits),
        "inner": _axis("inner", _registers("inner axis", "inner", devices.inner, links), limits.inner_deg, limits),
    }
    reader = _registers("reader", "reader", devices.reader, links)
    _, fastest = tighter((0.0, limits.rate_hz), reader.profile, "rate")
    chamber, where = profile_of(devices.chamber), devices.slots
    banks = {
        slot: Registers(f"slot {slot}", links.registers("slots"), where.device_id + slot, profile_of(where))
        for slot in slots
    }
    parts = (
        TiltTable(axes["outer"], axes["inner"], clock),
        adapter_of(chamber, "chamber", ThermalChamber)(
            _values("chamber", "chamber", devices.chamber, links), *tighter(limits.temperature_C, chamber, "set_point")
        ),
        Reader(reader, {slot: Slot(registers) for slot, registers in banks.items()}, fastest),
    )
    equipment = {
        role: adapter_of(profile_of(device), role, Equipment)(
            _values(role.replace("_", " "), role, device, links), clock
        )
        for role, device in config.fitted().items()
        if role in roles
    }
    steps = [*equipment_steps(equipment), *safe_steps(config.safety, axes, *parts[1:])]
    return Station(config, clock, *parts, safe_steps=steps, equipment=equipment)


def _values(name: str, key: str, device: Device, links: Links) -> Values:
    """Values of a device: text commands on a link for lines, registers on any other."""
    if device.link in TEXT_CARRIERS:
        return Commands(name, links.lines(key), profile_of(device))
    return _registers(name, key, device, links)


def _registers(name: str, key: str, device: Device, links: Links) -> Registers:
    return Registers(name, links.registers(key), device.device_id, profile_of(device))


def _axis(
    which: Literal["outer", "inner"], registers: Registers, bounds: tuple[float, float], limits: Limits
) -> TableAxis:
    """The adapter of an axis, limited by the drive's profile and the station's file."""
    profile = registers.profile
    speed, acceleration = (
        tighter((0.0, wanted), profile, name if profile.has(name) else f"{which}_{name}")[1]
        for name, wanted in (("speed", limits.speed_deg_s), ("acceleration", limits.acceleration_deg_s2))
    )
    allowed = limits.model_copy(update={"speed_deg_s": speed, "acceleration_deg_s2": acceleration})
    return adapter_of(profile, "axis", TableAxis)(registers, tighter(bounds, profile, "target"), allowed, which)


def tighter(bounds: tuple[float, float], profile: Profile, name: str) -> tuple[float, float]:
    """The intersection of the station's bounds with those of a value in the profile."""
    if not profile.has(name):
        return bounds
    entry = profile.entry(name)
    low, high = limits_of(entry)
    low, high = max(bounds[0], low), min(bounds[1], high)
    if low >= high:
        raise RecipeInvalid(
            f"profile {profile.name}: {name} from {entry.minimum} to {entry.maximum} {entry.unit}, the station's limits are "
            f"{bounds[0]:g} to {bounds[1]:g}: nothing is allowed by both; correct [limits] in the station's file",
            key="limits",
        )
    return low, high


@contextmanager
def one_processor() -> Generator[None]:
    """A block whose thread, and threads that it starts, are pinned to a processor that no other such block of the user has.

    Nothing is pinned if no processor is free, or if the system does not support it.
    """
    with ExitStack() as stack:
        number = _claimed(stack)
        if number is not None:
            stack.callback(_pin, *os.sched_getaffinity(0))
            _pin(number)
        yield


def _pin(*numbers: int) -> None:
    """Pin this thread to some processors; without effect if they are no longer allowed (a changed cpuset)."""
    with suppress(OSError):
        os.sched_setaffinity(0, numbers)


def _claimed(stack: ExitStack) -> int | None:
    """A processor claimed until the stack is left or the process is killed; None if all are claimed or there is only one."""
    if not hasattr(os, "sched_setaffinity") or len(allowed := os.sched_getaffinity(0)) < 2:
        return None
    for number in sorted(allowed):
        path = Path(tempfile.gettempdir()) / _NAME.format(user=os.getuid(), number=number)
        try:
            file = os.open(path, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except OSError:
            return None
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # another block has it
            os.close(file)
            continue
        stack.callback(os.close, file)
        return number
    return None
