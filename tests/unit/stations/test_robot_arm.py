"""An arm over Modbus as the tilt table: angles from its rotation vector, orders through its program, what whole mrad cost."""

import math
import re
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from other_devices import station_with
from scipy.spatial.transform import Rotation
from small_station import lot_of

from schemas.errors import OperatorNeeded, StationRefused
from stations.devices.families.robot_arm import angles_of
from stations.opening import make_plant, serve_plant


def away(first: float, second: float) -> float:
    return abs(math.remainder(first - second, 360.0))


def test_every_pose_of_a_turn_is_read_from_its_rotation_vector() -> None:
    for outer, inner in product(range(-180, 181, 15), repeat=2):
        found = angles_of(Rotation.from_euler("XZ", [outer, inner], degrees=True).as_rotvec().tolist())
        assert max(away(found[0], outer), away(found[1], inner)) < 1e-6, (outer, inner)


def test_whole_milliradians_cost_less_than_is_stated_for_them() -> None:
    errors = []
    for outer, inner in np.random.default_rng(4).uniform(-180.0, 180.0, (2000, 2)).tolist():
        turned = Rotation.from_euler("XZ", [outer, inner], degrees=True)
        found = angles_of(np.round(turned.as_rotvec(), 3).tolist())
        assert max(away(found[0], outer), away(found[1], inner)) < math.degrees(1e-3)
        errors.append(Rotation.from_euler("XZ", found, degrees=True).as_matrix()[2] - turned.as_matrix()[2])
    assert 100e-6 < np.std(errors) < 1e-3 / math.sqrt(12.0)  # force in g: below 289 µrad


def test_an_arm_goes_to_poses_beyond_half_a_turn_and_stops_for_a_person() -> None:
    config, lot = station_with("universal_robots"), lot_of(1)
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        table = station.table
        for outer, inner in ((70.0, 340.0), (180.0, -190.0), (-90.0, 0.0)):
            table.move(outer, inner)
            assert table.angles() == pytest.approx((outer, inner), abs=table.axes["outer"].resolution_deg)
            force = plant.physics.force_at(plant.now)
            wanted = Rotation.from_euler("XZ", [outer, inner], degrees=True).as_matrix()[2]
            assert np.abs(force[0] - wanted).max() < 5e-3  # the seat of the slot
        with pytest.raises(StationRefused, match="200 deg is allowed"):
            table.move(210.0, 0.0)
        plant.emergency_stop = True
        with pytest.raises(OperatorNeeded, match="emergency stop at the arm"):
            table.move(10.0, 10.0)


GUIDE = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "poses-from-a-robot-arm.md"


class Ended(Exception):
    """The program has had its turns."""


class Controller:
    """Registers and threads of a controller that carries out the program of the guide, line by line."""

    def __init__(self, registers: dict[int, int], writes: dict[str, dict[int, int]], turns: int = 3) -> None:
        self.registers = dict.fromkeys(range(128, 137), 0) | registers
        self.writes, self.turns, self.log = writes, turns, list[str]()

    def event(self, name: str) -> None:
        """Something happens at the arm; the host writes its orders meanwhile, once."""
        self.log.append(name)
        self.registers |= self.writes.pop(name, {})

    def sync(self) -> None:
        self.turns -= 1
        self.event("sync")
        if self.turns == 0:
            raise Ended

    def run(self) -> None:
        """The program as Python: its blocks are the same, without ``end``."""
        text = GUIDE.read_text(encoding="utf-8").split("```text\n")[1].split("```")[0]
        text = re.sub(r"^ *end\n", "", text, flags=re.MULTILINE)
        for found, written in (
            (r"thread (\w+)\(\):", r"def \1():"), (r"run (\w+)\(\)", r"run(\1)"), (r"kill (\w+)", r"kill(\1)"), (r"\bp\[", "["),
        ):  # fmt: skip
            text = re.sub(found, written, text)
        place = {
            "get_actual_tcp_pose": lambda: [0.0] * 6,
            "read_port_register": self.registers.__getitem__,
            "write_port_register": self.registers.__setitem__,
            "run": lambda thread: self.event(thread.__name__),
            "kill": lambda _: None,
            "stopj": lambda _: self.event("stopj"),
            "sync": self.sync,
        }
        exec(text, place)
        with pytest.raises(Ended):
            place["poses"]()


def test_the_program_of_the_guide_moves_by_orders_only() -> None:
    idle = Controller({128: 4500, 129: 1000, 130: 1000, 131: 1}, {})
    idle.run()
    assert "Go" not in idle.log  # an order of before the start is forgotten
    ordered = Controller({}, {"sync": {135: 1}})
    ordered.run()
    assert ordered.log.count("Go") == 1
    assert ordered.registers[135] == 3


@pytest.mark.parametrize("order", [131, 135])
@pytest.mark.parametrize("stopped", [131, 135])
def test_a_stop_while_the_program_brakes_for_an_order_is_kept(order: int, stopped: int) -> None:
    arm = Controller({}, {"sync": {order: 1}, "stopj": {stopped: 2}})
    arm.run()
    assert "Go" not in arm.log
    assert arm.log.count("stopj") == 2
    assert (arm.registers[131], arm.registers[135]) == (0, 0)


def test_speeds_that_the_arm_does_not_take_are_not_asked_of_it() -> None:
    config, lot = station_with("universal_robots"), lot_of(1)
    faster = config.model_copy(update={"limits": config.limits.model_copy(update={"speed_deg_s": 90.0})})
    with serve_plant(faster, lot, make_plant(faster, lot)) as station:
        station.table.move(10.0, -10.0)
        assert station.table.angles() == pytest.approx((10.0, -10.0), abs=0.1)
