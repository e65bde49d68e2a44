"""The simulated IAI ROBO Cylinder controller."""

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Busy, Source, bits_of, store, stored
from stations.plant.controller import start_move
from stations.plant.table import Axis
from stations.plant.world import World


def simulated(world: World, axis: Axis, profile: Profile) -> Bank:
    """IAI ROBO Cylinder: a write of the target starts the move, with the band, speed and acceleration written before."""
    settings: dict[str, Value] = {"position_band": 0.1, "speed": 10.0, "acceleration": 9.80665}
    coils: dict[str, Value] = dict.fromkeys(("servo_on", "alarm_reset", "pause", "home", "serial_mode"), 0)

    def status() -> Value:
        flags = {"ready": True, "servo_on": coils["servo_on"] == 1, "paused": coils["pause"] == 1}
        flags |= {"home_end": axis.homed, "in_position": axis.in_position(world.now)}
        flags["emergency_stop"] = world.emergency_stop
        return bits_of(profile.register("status"), flags)

    def more() -> Value:
        flags = {"serial_mode": coils["serial_mode"] == 1, "move": axis.moving(world.now)}
        return bits_of(profile.register("extended_status"), flags)

    def command(values: dict[str, Value]) -> None:
        store(settings, values)
        store(coils, values)
        if values.get("alarm_reset") == 1 and coils["pause"] == 1:
            axis.halt(world.now)
        if "target" not in values:
            return
        if coils["servo_on"] != 1 or coils["serial_mode"] != 1 or coils["pause"] == 1 or not axis.homed:
            raise Busy(profile.name)
        start_move(world, axis, profile, {**settings, "target": values["target"]})

    sources: dict[str, Source] = {
        **stored(settings),
        **stored(coils),
        "feedback_position": lambda: axis.encoder(world.now),
        **{name: lambda: 0 for name in ("alarm", "inputs", "outputs")},
        "status": status,
        "status_2": lambda: 1 << profile.register("status_2").bits["enabled"],
        "extended_status": more,
    }
    return Bank(profile, sources, command)
