"""The register banks of the simulated station: which value of the plant stands behind which register."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from stations.codec import NotEncodable, Value, named
from stations.plant.bank import Bank, Busy
from stations.profile_files import load_profile

if TYPE_CHECKING:
    from schemas.station import Devices
    from stations.plant.plant import Plant
    from stations.plant.table import Axis

UNITS = {"V": "volt", "LSB": "lsb"}


def build_banks(plant: Plant, devices: Devices) -> dict[int, Bank]:
    """A bank for every device id of the station."""
    banks = {
        devices.outer.device_id: _axis(plant, plant.outer, devices.outer.profile),
        devices.inner.device_id: _axis(plant, plant.inner, devices.inner.profile),
        devices.chamber.device_id: _chamber(plant, devices.chamber.profile),
        devices.reader.device_id: _reader(plant, devices.reader.profile, devices.slots.count),
    }
    for unit, slot in enumerate(plant.slots):
        banks[devices.slots.device_id + slot] = _slot(plant, unit, devices.slots.profile)
    return banks


def _number(values: dict[str, Value], name: str) -> float:
    value = values[name]
    if not isinstance(value, int | float):
        message = f"{name}: {value!r} is not a number"
        raise NotEncodable(message)
    return float(value)


def _axis(plant: Plant, axis: Axis, name: str) -> Bank:
    profile = load_profile(name)
    bits = profile.register("status").bits

    def status() -> Value:
        now = plant.now
        moving = axis.moving(now)
        flags = {"home_end": axis.homed, "ready": not moving, "busy": moving, "move": moving}
        flags["in_position"] = axis.in_position(now)
        return sum(1 << bits[flag] for flag, up in flags.items() if up)

    def command(values: dict[str, Value]) -> None:
        if "target" not in values:
            return  # the level inputs: the simulated drive is moved by direct data only
        if values.get("trigger") != 1 or values.get("operation_type") != 1:
            message = "direct data: only absolute moves, triggered at once, are simulated"
            raise NotEncodable(message)
        if axis.moving(plant.now):
            raise Busy(profile.name)
        axis.go(plant.now, _number(values, "target"), _number(values, "speed"), _number(values, "acceleration"))

    sources = {
        "command": lambda: 0,
        "status": status,
        "alarm": lambda: 0,
        "command_position": lambda: axis.move.target,
        "feedback_position": lambda: axis.encoder(plant.now),
        "motor_temperature": lambda: 30.0,
    }
    return Bank(profile, sources, command)


def _chamber(plant: Plant, name: str) -> Bank:
    profile, chamber = load_profile(name), plant.fixture.chamber

    def mode() -> Value:
        return "automatic" if chamber.running else "off"

    def command(values: dict[str, Value]) -> None:
        if "mode" in values:
            chosen = named(profile.register("mode"), _number(values, "mode"))
            if chosen not in {"automatic", "off"}:
                message = "mode: the simulated chamber knows automatic and off"
                raise NotEncodable(message)
            chamber.running = chosen == "automatic"
        if "set_point" in values:
            chamber.set_point = _number(values, "set_point")
        if "ramp_rate" in values:
            chamber.ramp_K_min = _number(values, "ramp_rate")

    point = profile.register("set_point")
    sources = {
        "part_number": lambda: "TUMBLELINE-SIM",
        "status": lambda: "static",
        "decimals": lambda: 1,
        "mode": mode,
        "actual_mode": mode,
        "set_point_low": lambda: point.minimum or 0.0,
        "set_point_high": lambda: point.maximum or 0.0,
        "set_point": lambda: chamber.set_point,
        "ramp_action": lambda: "set_point",
        "ramp_scale": lambda: "per_minute",
        "ramp_rate": lambda: chamber.ramp_K_min,
        "power": lambda: 100.0 * chamber.power,
        "working_set_point": lambda: chamber.working,
        "temperature": plant.air_reading,
    }
    return Bank(profile, sources, command)


def _reader(plant: Plant, name: str, slots: int) -> Bank:
    profile, sampler = load_profile(name), plant.sampler

    def command(values: dict[str, Value]) -> None:
        if "rate" in values:
            if sampler.running:
                raise Busy(profile.name)
            sampler.millihertz = round(1000.0 * _number(values, "rate"))
        if "sampling" in values:
            if values["sampling"] == 1:
                sampler.start(plant.now_us)
            else:
                sampler.stop()

    sources = {
        "slots": lambda: slots,
        "sampling": lambda: int(sampler.running),
        "rate": lambda: sampler.rate,
        "since_power": lambda: plant.now,
        "door": lambda: int(plant.fixture.chamber.door_open),
        "emergency_stop": lambda: int(plant.emergency_stop),
        "vibration": plant.vibration_reading,
        "occupied": lambda: sum(1 << slot for slot in plant.slots),
        "temperature": plant.temperature_reading,
        "supply": plant.supply_reading,
    }
    return Bank(profile, sources, command)


def _slot(plant: Plant, unit: int, name: str) -> Bank:
    profile, sampler, preset = load_profile(name), plant.sampler, plant.preset
    bits = profile.register("flags").bits

    def flags() -> Value:
        return (sampler.running << bits["running"]) | (sampler.overflow[unit] << bits["overflow"])

    def taken(values: dict[str, Value]) -> None:
        tail = int(_number(values, "tail"))
        if not sampler.tail[unit] <= tail <= sampler.head:
            message = f"tail: {tail}, {sampler.tail[unit]} to {sampler.head} is needed"
            raise NotEncodable(message)
        sampler.tail[unit] = tail

    sources = {
        "serial": lambda: plant.serials[unit],
        "packing": lambda: preset.packing,
        "output_unit": lambda: UNITS[preset.output_unit],
        "lsb": lambda: preset.lsb,
        "full_scale": lambda: preset.full_scale,
        "capacity": lambda: sampler.capacity,
        "head": lambda: sampler.head,
        "tail": lambda: sampler.tail[unit],
        "flags": flags,
    }
    return Bank(profile, sources, taken, partial(sampler.words, unit))
