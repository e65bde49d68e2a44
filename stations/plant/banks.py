"""The register banks of the simulated station: the value of the world behind each register."""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module
from typing import Any, Protocol

from schemas.profile import Profile
from schemas.station_devices import Device, Devices
from stations.codec import NotEncodable, Value
from stations.plant import families
from stations.plant.bank import Bank, Busy, number
from stations.plant.memory_bank import MemoryBank
from stations.plant.table import Axis
from stations.plant.world import World
from stations.profile_files import profile_of

UNITS = {"V": "volt", "LSB": "lsb"}


def build_banks(world: World, devices: Devices, equipment: Mapping[str, Device] | None = None) -> dict[int, Bank]:
    """A bank for every device id of the station that holds registers."""
    banks = {
        devices.outer.device_id: axis_bank(world, world.outer, profile_of(devices.outer)),
        devices.inner.device_id: axis_bank(world, world.inner, profile_of(devices.inner)),
        devices.reader.device_id: _reader(world, profile_of(devices.reader), devices.slots.count),
    }
    if (chamber := profile_of(devices.chamber)).registers:
        banks[devices.chamber.device_id] = chamber_bank(world, chamber)
    for unit, slot in enumerate(world.slots):
        banks[devices.slots.device_id + slot] = _slot(world, unit, profile_of(devices.slots))
    for device in (equipment or {}).values():
        if (own := profile_of(device)).registers:
            banks[device.device_id] = chamber_bank(world, own)
    return banks


def build_line_devices(
    world: World, devices: Devices, equipment: Mapping[str, Device] | None = None
) -> dict[int, LineDevice]:
    """Devices with a text protocol, by device id."""
    profile = profile_of(devices.chamber)
    line_devices = {devices.chamber.device_id: chamber_line_device(world, profile)} if profile.commands else {}
    for device in (equipment or {}).values():
        if (own := profile_of(device)).commands:
            line_devices[device.device_id] = chamber_line_device(world, own)
    return line_devices


def _reader(world: World, profile: Profile, slots: int) -> Bank:
    sampler = world.sampler

    def command(values: dict[str, Value]) -> None:
        if "rate" in values:
            if sampler.running:
                raise Busy(profile.name)
            sampler.millihertz = round(1000.0 * number(values, "rate"))
        if "power" in values:
            world.switch(on=values["power"] == 1)
        if "sampling" in values:
            if values["sampling"] == 1:
                sampler.start(world.now_us)
            else:
                sampler.stop()

    sources = {
        "slots": lambda: slots,
        "sampling": lambda: int(sampler.running),
        "rate": lambda: sampler.rate,
        "since_power": lambda: world.since_power,
        "power": lambda: int(world.powered),
        "door": lambda: int(world.fixture.chamber.door_open),
        "emergency_stop": lambda: int(world.emergency_stop),
        "vibration": world.vibration_reading,
        "occupied": lambda: sum(1 << slot for slot in world.slots),
        "temperature": world.temperature_reading,
        "supply": world.supply_reading,
        "humidity": world.humidity_reading,
    }
    return Bank(profile, sources, command)


def _slot(world: World, unit: int, profile: Profile) -> Bank:
    sampler, preset = world.sampler, world.preset
    memory = MemoryBank(world, unit)
    bits = profile.register("flags").bits

    def flags() -> Value:
        return (sampler.running << bits["running"]) | (sampler.overflow[unit] << bits["overflow"])

    def commanded(values: dict[str, Value]) -> None:
        if "tail" in values:
            taken(values)
        memory.write({name: value for name, value in values.items() if name != "tail"})

    def taken(values: dict[str, Value]) -> None:
        tail = int(number(values, "tail"))
        if not sampler.tail[unit] <= tail <= sampler.head:
            raise NotEncodable(f"tail: {tail}, {sampler.tail[unit]} to {sampler.head} is needed")
        sampler.tail[unit] = tail

    sources = {
        "serial": lambda: world.serials[world.seats[unit]],
        "packing": lambda: preset.packing,
        "output_unit": lambda: UNITS[preset.output_unit],
        "lsb": lambda: preset.lsb,
        "full_scale": lambda: preset.full_scale,
        "capacity": lambda: sampler.capacity,
        "head": lambda: sampler.head,
        "tail": lambda: sampler.tail[unit],
        "flags": flags,
        **memory.sources(),
    }
    return Bank(profile, sources, commanded, lambda first, count: sampler.words(world.seats[unit], first, count))


def family_names() -> list[str]:
    """Names of the simulated families, sorted."""
    return sorted(module.name for module in pkgutil.iter_modules(families.__path__))


def axis_bank(world: World, axis: Axis, profile: Profile) -> Bank:
    """The registers of the drive with a profile."""
    return _module(profile).simulated(world, axis, profile)


def chamber_bank(world: World, profile: Profile) -> Bank:
    """The registers of the chamber controller with a profile."""
    return _module(profile).simulated(world, profile)


def chamber_line_device(world: World, profile: Profile) -> LineDevice:
    """The chamber controller with a profile of text commands."""
    return _module(profile).simulated(world, profile)


def _module(profile: Profile) -> Any:
    if profile.adapter not in family_names():
        raise LookupError(
            f"profile {profile.name}: no simulation of family {profile.adapter}, one is needed; add "
            f"stations/plant/families/{profile.adapter}.py with a function 'simulated'"
        )
    return import_module(f"{families.__name__}.{profile.adapter}")


class LineDevice(Protocol):
    """A device that answers lines of text."""

    def answer(self, line: str) -> tuple[str, bool]:
        """The answer to a line, and whether the line changed anything."""
        ...
