"""The register banks of the simulated station: which value of the plant stands behind which register."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stations.codec import NotEncodable, Value
from stations.plant.bank import Bank, Busy, number
from stations.plant.bank_axes import axis_bank
from stations.plant.bank_chambers import chamber_bank
from stations.plant.bank_lines import P300
from stations.profile_files import profile_of

if TYPE_CHECKING:
    from schemas.profile import Profile
    from schemas.station import Devices
    from stations.plant.plant import Plant

UNITS = {"V": "volt", "LSB": "lsb"}


def build_banks(plant: Plant, devices: Devices) -> dict[int, Bank]:
    """A bank for every device id of the station."""
    banks = {
        devices.outer.device_id: axis_bank(plant, plant.outer, profile_of(devices.outer)),
        devices.inner.device_id: axis_bank(plant, plant.inner, profile_of(devices.inner)),
        devices.reader.device_id: _reader(plant, profile_of(devices.reader), devices.slots.count),
    }
    if (chamber := profile_of(devices.chamber)).registers:
        banks[devices.chamber.device_id] = chamber_bank(plant, chamber)
    for unit, slot in enumerate(plant.slots):
        banks[devices.slots.device_id + slot] = _slot(plant, unit, profile_of(devices.slots))
    return banks


def build_speakers(plant: Plant, devices: Devices) -> dict[int, P300]:
    """What answers in lines of text, by device id."""
    profile = profile_of(devices.chamber)
    return {devices.chamber.device_id: P300(plant, profile)} if profile.commands else {}


def _reader(plant: Plant, profile: Profile, slots: int) -> Bank:
    sampler = plant.sampler

    def command(values: dict[str, Value]) -> None:
        if "rate" in values:
            if sampler.running:
                raise Busy(profile.name)
            sampler.millihertz = round(1000.0 * number(values, "rate"))
        if "power" in values:
            plant.switch(on=values["power"] == 1)
        if "sampling" in values:
            if values["sampling"] == 1:
                sampler.start(plant.now_us)
            else:
                sampler.stop()

    sources = {
        "slots": lambda: slots,
        "sampling": lambda: int(sampler.running),
        "rate": lambda: sampler.rate,
        "since_power": lambda: plant.since_power,
        "power": lambda: int(plant.powered),
        "door": lambda: int(plant.fixture.chamber.door_open),
        "emergency_stop": lambda: int(plant.emergency_stop),
        "vibration": plant.vibration_reading,
        "occupied": lambda: sum(1 << slot for slot in plant.slots),
        "temperature": plant.temperature_reading,
        "supply": plant.supply_reading,
        "humidity": plant.humidity_reading,
    }
    return Bank(profile, sources, command)


def _slot(plant: Plant, unit: int, profile: Profile) -> Bank:
    sampler, preset = plant.sampler, plant.preset
    bits = profile.register("flags").bits

    def flags() -> Value:
        return (sampler.running << bits["running"]) | (sampler.overflow[unit] << bits["overflow"])

    def taken(values: dict[str, Value]) -> None:
        tail = int(number(values, "tail"))
        if not sampler.tail[unit] <= tail <= sampler.head:
            raise NotEncodable(f"tail: {tail}, {sampler.tail[unit]} to {sampler.head} is needed")
        sampler.tail[unit] = tail

    sources = {
        "serial": lambda: plant.serials[plant.seats[unit]],
        "packing": lambda: preset.packing,
        "output_unit": lambda: UNITS[preset.output_unit],
        "lsb": lambda: preset.lsb,
        "full_scale": lambda: preset.full_scale,
        "capacity": lambda: sampler.capacity,
        "head": lambda: sampler.head,
        "tail": lambda: sampler.tail[unit],
        "flags": flags,
    }
    return Bank(profile, sources, taken, lambda first, count: sampler.words(plant.seats[unit], first, count))
