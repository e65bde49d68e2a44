"""The simulated Oriental Motor AZ drive."""

from schemas.profile import Profile
from stations.codec import NotEncodable, Value
from stations.plant.bank import Bank, bits_of, number
from stations.plant.controller import ABSOLUTE, start_move
from stations.plant.table import Axis
from stations.plant.world import World


def simulated(world: World, axis: Axis, profile: Profile) -> Bank:
    """Oriental Motor AZ: the trigger in the direct data starts the move; the STOP input ends it."""
    stop = 1 << profile.register("command").bits["stop"]
    level = {"command": 0}

    def status() -> Value:
        moving = axis.moving(world.now)
        flags = {"home_end": axis.homed, "ready": not moving, "busy": moving, "move": moving}
        flags["in_position"] = axis.in_position(world.now)
        return bits_of(profile.register("status"), flags)

    def command(values: dict[str, Value]) -> None:
        if "command" in values:
            level["command"] = int(number(values, "command"))
            if level["command"] & stop:
                axis.halt(world.now)
        if "target" not in values:
            return
        if values.get("trigger") != 1 or values.get("operation_type") != ABSOLUTE:
            raise NotEncodable("direct data: only absolute moves with an immediate trigger are simulated")
        start_move(world, axis, profile, values)

    sources = {
        "command": lambda: level["command"],
        "status": status,
        "alarm": lambda: 0,
        "command_position": lambda: axis.move.target,
        "feedback_position": lambda: axis.encoder(world.now),
        "motor_temperature": lambda: 30.0,
    }
    return Bank(profile, sources, command)
