"""The simulated arm: a program that turns its tool, and a Modbus server that shows the pose of the tool in whole milliradians."""

import math

from scipy.spatial.transform import Rotation

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Source, number, store, stored
from stations.plant.table import Axis
from stations.plant.world import World

DONE, GO, STOP, MOVING = range(4)
MODE = {True: 7, False: 5}  # running, idle
SHOULDER_RAD = (0.0, -1.571, 1.571, 0.0)  # joints that hold the wrist in front of the base
TCP_MM = (450.0, -120.0, 520.0)


def simulated(world: World, axis: Axis, profile: Profile) -> Bank:
    """One angle of the arm: orders of this angle move it; the pose that is read is that of both."""
    which = "inner" if axis is world.inner else "outer"
    held: dict[str, Value] = {
        f"{angle}_{name}": value
        for angle in ("outer", "inner")
        for name, value in (("target", 0.0), ("speed", 10.0), ("acceleration", 10.0))
    }

    def command(values: dict[str, Value]) -> None:
        store(held, values)
        order = values.get(f"{which}_order")
        if order == STOP:
            axis.halt(world.now)
        elif order == GO and axis.homed:
            figures = (number(held, f"{which}_{name}") for name in ("target", "speed", "acceleration"))
            axis.go(world.now, *figures)

    def tool() -> Rotation:
        angles = [world.outer.encoder(world.now), world.inner.encoder(world.now)]
        return Rotation.from_euler("XZ", angles, degrees=True)

    def order_of(axis: Axis) -> Source:
        return lambda: MOVING if axis.moving(world.now) else DONE

    def joints() -> Value:
        wrist = [math.radians(joint.encoder(world.now)) for joint in (world.outer, world.inner)]
        return [angle % (2.0 * math.pi) for angle in (*SHOULDER_RAD, *wrist)]

    sources: dict[str, Source] = {
        **stored(held),
        "outer_order": order_of(world.outer),
        "inner_order": order_of(world.inner),
        "program": lambda: 1,
        "robot_mode": lambda: MODE[axis.homed],
        "power": lambda: 1,
        "security_stop": lambda: 0,
        "emergency_stop": lambda: int(world.emergency_stop),
        "joints": joints,
        "position": lambda: list(TCP_MM),
        "rotation": lambda: [float(part) for part in tool().as_rotvec()],
    }
    return Bank(profile, sources, command)
