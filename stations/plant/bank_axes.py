"""Registers of the simulated servo drives: one kind of motion, each drive's own way of being told."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from stations.codec import NotEncodable, Value
from stations.plant.bank import Bank, Busy, number

if TYPE_CHECKING:
    from schemas.profile import Profile
    from stations.plant.table import Axis
    from stations.plant.world import World

GO = 0x0100
ABSOLUTE = 1


def axis_bank(world: World, axis: Axis, profile: Profile) -> Bank:
    """The registers of the drive behind a profile."""
    return _BY_ADAPTER[profile.adapter](world, axis, profile)


def _direct_data(world: World, axis: Axis, profile: Profile) -> Bank:
    """Oriental Motor AZ: the trigger inside the data starts the move; the STOP input ends it."""
    bits = profile.register("status").bits
    stop = 1 << profile.register("command").bits["stop"]
    level = {"command": 0}

    def status() -> Value:
        moving = axis.moving(world.now)
        flags = {"home_end": axis.homed, "ready": not moving, "busy": moving, "move": moving}
        flags["in_position"] = axis.in_position(world.now)
        return sum(1 << bits[flag] for flag, up in flags.items() if up)

    def command(values: dict[str, Value]) -> None:
        if "command" in values:
            level["command"] = int(number(values, "command"))
            if level["command"] & stop:
                axis.halt(world.now)
        if "target" not in values:
            return
        if values.get("trigger") != 1 or values.get("operation_type") != ABSOLUTE:
            raise NotEncodable("direct data: only absolute moves, triggered at once, are simulated")
        _go(world, axis, profile, values)

    sources = {
        "command": lambda: level["command"],
        "status": status,
        "alarm": lambda: 0,
        "command_position": lambda: axis.move.target,
        "feedback_position": lambda: axis.encoder(world.now),
        "motor_temperature": lambda: 30.0,
    }
    return Bank(profile, sources, command)


def _step_data(world: World, axis: Axis, profile: Profile) -> Bank:
    """SMC LEC: step data are kept; the start register moves a drive that is told to listen and whose servo is on."""
    names = [*profile.groups["step_data"], "serial_mode", "servo_on", "reset", "hold", "drive", "setup"]
    kept: dict[str, Value] = dict.fromkeys(names, 0)

    def command(values: dict[str, Value]) -> None:
        kept.update({name: value for name, value in values.items() if name in kept})
        if values.get("reset") == 1:
            axis.halt(world.now)
        listening = kept["serial_mode"] == 1 and kept["servo_on"] == 1 and axis.homed
        if values.get("start") != GO or not listening:
            return  # a drive that is not ready lets the start register be written, and stays where it is
        if kept["operation_type"] != ABSOLUTE:
            raise NotEncodable("step data: only absolute moves are simulated")
        _go(world, axis, profile, kept)

    def own(name: str) -> Callable[[], Value]:
        return lambda: kept[name]

    sources: dict[str, Callable[[], Value]] = {
        **{name: own(name) for name in names},
        "step_inputs": lambda: [0.0] * 6,
        "busy": lambda: int(axis.moving(world.now)),
        "servo_ready": lambda: kept["servo_on"],
        "homed": lambda: int(axis.homed),
        "in_position": lambda: int(axis.in_position(world.now)),
        "area": lambda: 0,
        "work_area": lambda: 0,
        "emergency_stop": lambda: int(not world.emergency_stop),
        "alarm": lambda: 1,
        "feedback_position": lambda: axis.encoder(world.now),
        "feedback_speed": lambda: axis.move.speed if axis.moving(world.now) else 0.0,
        "thrust": lambda: 0.0,
        "command_position": lambda: axis.move.target,
        "driving_data": lambda: 0,
    }
    return Bank(profile, sources, command)


def _numeric(world: World, axis: Axis, profile: Profile) -> Bank:
    """IAI ROBO Cylinder: writing the target moves at once, with what band, speed and acceleration were before."""
    status_bits, more_bits = profile.register("status").bits, profile.register("extended_status").bits
    kept: dict[str, Value] = {"position_band": 0.1, "speed": 10.0, "acceleration": 9.80665}
    coils: dict[str, Value] = dict.fromkeys(("servo_on", "alarm_reset", "pause", "home", "serial_mode"), 0)

    def status() -> Value:
        flags = {"ready": True, "servo_on": coils["servo_on"] == 1, "paused": coils["pause"] == 1}
        flags |= {"home_end": axis.homed, "in_position": axis.in_position(world.now)}
        flags["emergency_stop"] = world.emergency_stop
        return sum(1 << status_bits[flag] for flag, up in flags.items() if up)

    def more() -> Value:
        flags = {"serial_mode": coils["serial_mode"] == 1, "move": axis.moving(world.now)}
        return sum(1 << more_bits[flag] for flag, up in flags.items() if up)

    def command(values: dict[str, Value]) -> None:
        kept.update({name: value for name, value in values.items() if name in kept})
        coils.update({name: value for name, value in values.items() if name in coils})
        if values.get("alarm_reset") == 1 and coils["pause"] == 1:
            axis.halt(world.now)
        if "target" not in values:
            return
        if coils["servo_on"] != 1 or coils["serial_mode"] != 1 or coils["pause"] == 1 or not axis.homed:
            raise Busy(profile.name)
        _go(world, axis, profile, {**kept, "target": values["target"]})

    def own(held: dict[str, Value], name: str) -> Callable[[], Value]:
        return lambda: held[name]

    sources: dict[str, Callable[[], Value]] = {
        **{name: own(kept, name) for name in kept},
        **{name: own(coils, name) for name in coils},
        "feedback_position": lambda: axis.encoder(world.now),
        **{name: lambda: 0 for name in ("alarm", "inputs", "outputs")},
        "status": status,
        "status_2": lambda: 1 << profile.register("status_2").bits["enabled"],
        "extended_status": more,
    }
    return Bank(profile, sources, command)


def _go(world: World, axis: Axis, profile: Profile, values: dict[str, Value]) -> None:
    """Starts a move of a drive that stands."""
    if axis.moving(world.now):
        raise Busy(profile.name)
    axis.go(world.now, number(values, "target"), number(values, "speed"), number(values, "acceleration"))


_BY_ADAPTER = {"oriental_az": _direct_data, "smc_lec": _step_data, "iai_numeric": _numeric}
