"""The simulated IAI ROBO Cylinder controller."""

from collections.abc import Callable

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Busy
from stations.plant.controller import start_move
from stations.plant.table import Axis
from stations.plant.world import World


def simulated(world: World, axis: Axis, profile: Profile) -> Bank:
    """IAI ROBO Cylinder: a write of the target starts the move, with the band, speed and acceleration written before."""
    status_bits, more_bits = profile.register("status").bits, profile.register("extended_status").bits
    settings: dict[str, Value] = {"position_band": 0.1, "speed": 10.0, "acceleration": 9.80665}
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
        settings.update({name: value for name, value in values.items() if name in settings})
        coils.update({name: value for name, value in values.items() if name in coils})
        if values.get("alarm_reset") == 1 and coils["pause"] == 1:
            axis.halt(world.now)
        if "target" not in values:
            return
        if coils["servo_on"] != 1 or coils["serial_mode"] != 1 or coils["pause"] == 1 or not axis.homed:
            raise Busy(profile.name)
        start_move(world, axis, profile, {**settings, "target": values["target"]})

    def own(values: dict[str, Value], name: str) -> Callable[[], Value]:
        return lambda: values[name]

    sources: dict[str, Callable[[], Value]] = {
        **{name: own(settings, name) for name in settings},
        **{name: own(coils, name) for name in coils},
        "feedback_position": lambda: axis.encoder(world.now),
        **{name: lambda: 0 for name in ("alarm", "inputs", "outputs")},
        "status": status,
        "status_2": lambda: 1 << profile.register("status_2").bits["enabled"],
        "extended_status": more,
    }
    return Bank(profile, sources, command)
