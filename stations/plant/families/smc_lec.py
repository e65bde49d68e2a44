"""The simulated SMC LEC controller."""

from schemas.profile import Profile
from stations.codec import NotEncodable, Value
from stations.plant.bank import Bank, Source, store, stored
from stations.plant.controller import ABSOLUTE, start_move
from stations.plant.table import Axis
from stations.plant.world import World

GO = 0x0100


def simulated(world: World, axis: Axis, profile: Profile) -> Bank:
    """SMC LEC: step data are stored; the start register moves a drive in serial mode with its servo on."""
    names = [*profile.groups["step_data"], "serial_mode", "servo_on", "reset", "hold", "drive", "setup"]
    registers: dict[str, Value] = dict.fromkeys(names, 0)

    def command(values: dict[str, Value]) -> None:
        store(registers, values)
        if values.get("reset") == 1:
            axis.halt(world.now)
        ready = registers["serial_mode"] == 1 and registers["servo_on"] == 1 and axis.homed
        if values.get("start") != GO or not ready:
            return  # a drive that is not ready accepts the start register and does not move
        if registers["operation_type"] != ABSOLUTE:
            raise NotEncodable("step data: only absolute moves are simulated")
        start_move(world, axis, profile, registers)

    sources: dict[str, Source] = {
        **stored(registers),
        "step_inputs": lambda: [0.0] * 6,
        "busy": lambda: int(axis.moving(world.now)),
        "servo_ready": lambda: registers["servo_on"],
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
