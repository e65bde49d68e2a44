"""The register banks of the simulated station: the value of the world behind each register."""

import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Protocol

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.profile import Profile
from schemas.station_devices import Device, Devices
from stations.codec import NotEncodable, Value
from stations.plant import families
from stations.plant.bank import Bank, Busy, Source, number
from stations.plant.eeprom import Eeprom, bytes_of, words_of
from stations.plant.flash import Flash
from stations.plant.world import World
from stations.profile_files import profile_of

UNITS = {"V": "volt", "LSB": "lsb"}
PART = 64
PARTS = 3


def build_banks(world: World, devices: Devices, equipment: Mapping[str, Device]) -> dict[int, Bank]:
    """A bank for every device id of the station that holds registers."""
    others = [(device.device_id, profile_of(device)) for device in (devices.chamber, *equipment.values())]
    first, slots = devices.slots.device_id, profile_of(devices.slots)
    return {
        devices.outer.device_id: simulated(profile_of(devices.outer), world, world.outer),
        devices.inner.device_id: simulated(profile_of(devices.inner), world, world.inner),
        devices.reader.device_id: _reader(world, profile_of(devices.reader), devices.slots.count),
        **{first + slot: _slot(world, unit, slots) for unit, slot in enumerate(world.slots)},
        **{device_id: simulated(profile, world) for device_id, profile in others if profile.registers},
    }


def build_line_devices(world: World, devices: Devices, equipment: Mapping[str, Device]) -> "dict[int, LineDevice]":
    """Devices with a text protocol, by device id."""
    profiles = {device.device_id: profile_of(device) for device in (devices.chamber, *equipment.values())}
    return {device_id: simulated(profile, world) for device_id, profile in profiles.items() if profile.commands}


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
            tail = int(number(values, "tail"))
            if not sampler.tail[unit] <= tail <= sampler.head:
                raise NotEncodable(f"tail: {tail}, {sampler.tail[unit]} to {sampler.head} is needed")
            sampler.tail[unit] = tail
        memory.write({name: value for name, value in values.items() if name != "tail"})

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


def simulated(profile: Profile, *of: object) -> Any:
    """The simulated controller with a profile, of a world and, for a drive, its axis: its bank, or its line device."""
    if profile.adapter not in family_names():
        cure = f"{did_you_mean(profile.adapter, family_names())} (or add stations/plant/families/{profile.adapter}.py)"
        raise RecipeInvalid(f"profile {profile.name}: no simulated '{profile.adapter}'; {cure}", key="adapter")
    return import_module(f"{families.__name__}.{profile.adapter}").simulated(*of, profile)


class LineDevice(Protocol):
    """A device that answers lines of text."""

    def answer(self, line: str) -> tuple[str, bool]:
        """The answer to a line, and whether the line changed anything."""
        ...


@dataclass
class MemoryBank:
    """Memory registers of the device in a slot, by the index of the slot."""

    world: World
    index: int

    @property
    def unit(self) -> int:
        """The unit that is seated in the slot."""
        return self.world.seats[self.index]

    @property
    def flash(self) -> Flash:
        """The flash memory of the unit in the slot."""
        return self.world.flash[self.unit]

    @property
    def teds(self) -> Eeprom:
        """The TEDS memory on the signal line of the unit in the slot."""
        return self.world.teds[self.unit]

    def sources(self) -> dict[str, Source]:
        """Values of the registers."""
        sources: dict[str, Source] = {
            "memory_state": lambda: self.flash.state(self.world.now_us),
            "memory_command": lambda: 0,
            "erases_a": lambda: self.flash.erases[0],
            "erases_b": lambda: self.flash.erases[1],
            "endurance": lambda: self.flash.endurance,
            "offset_step": lambda: self.world.preset.offset_step,
            "offset": lambda: [float(step) for step in self.flash.offsets],
            "teds_address": lambda: self.teds.address,
            "teds_scratchpad": lambda: words_of(self.teds.row),
            "teds_command": lambda: 0,
            "teds_check": lambda: self.teds.check,
            "teds_status": lambda: self.teds.status,
            "teds_memory": lambda: words_of(bytes(self.teds.memory)),
        }
        for part in range(PARTS):
            sources[f"buffer_{part}"] = lambda part=part: _part(self.flash.buffer, part)
            sources[f"copy_a_{part}"] = lambda part=part: _part(self.flash.read(0, self.world.now_us), part)
            sources[f"copy_b_{part}"] = lambda part=part: _part(self.flash.read(1, self.world.now_us), part)
        return sources

    def write(self, values: dict[str, Value]) -> None:
        """Applies writes; a device that has no power, or is sampling, refuses them."""
        if values and (not self.world.powered or self.world.sampler.running):
            raise Busy("memory")
        for name, value in values.items():
            if name.startswith("buffer_") and isinstance(value, list):
                part = int(name.removeprefix("buffer_"))
                self.flash.buffer[part * PART : (part + 1) * PART] = [int(word) for word in value]
            elif name == "offset" and isinstance(value, list):
                if not self.world.preset.offset_step:
                    raise NotEncodable("offset: the device has no offset registers")
                self.world.set_offsets(self.unit, [int(step) for step in value])
            elif name.startswith("teds_"):
                self._write_teds(name, value)
            elif name == "memory_command" and (command := int(number(values, name))):
                if self.flash.state(self.world.now_us) == 1:
                    raise Busy("memory")
                self.world.program_memory(self.unit, command - 1)

    def _write_teds(self, name: str, value: Value) -> None:
        """Address, row or command of the memory on the signal line."""
        if name == "teds_address":
            self.teds.address = int(number({name: value}, name))
        elif name == "teds_scratchpad" and isinstance(value, list):
            self.teds.row = bytes_of(value)
        elif (code := int(number({name: value}, name))) and not self.teds.command(code):
            raise NotEncodable(f"teds_command: {code} at byte {self.teds.address} is no command of the memory")


def _part(words: list[int], part: int) -> list[float]:
    return [float(word) for word in words[part * PART : (part + 1) * PART]]
