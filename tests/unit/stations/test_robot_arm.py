"""An arm over Modbus as the tilt table: angles from its rotation vector, orders through its program, what whole mrad cost."""

import math

import numpy as np
import pytest
from other_devices import station_with
from scipy.spatial.transform import Rotation
from small_station import lot_of

from schemas.errors import OperatorNeeded, StationRefused
from stations.devices.families.robot_arm import angles_of
from stations.opening import make_plant, serve_plant

ANGLES = [(o, i) for o in range(-180, 181, 15) for i in range(-180, 181, 15)]


def away(first: float, second: float) -> float:
    return abs(math.remainder(first - second, 360.0))


def test_every_pose_of_a_turn_is_read_from_its_rotation_vector() -> None:
    for outer, inner in ANGLES:
        found = angles_of(Rotation.from_euler("XZ", [outer, inner], degrees=True).as_rotvec().tolist())
        assert away(found[0], outer) < 1e-6, (outer, inner)
        assert away(found[1], inner) < 1e-6, (outer, inner)


def test_whole_milliradians_cost_less_than_is_stated_for_them() -> None:
    rng = np.random.default_rng(4)
    errors = []
    for outer, inner in rng.uniform(-180.0, 180.0, (2000, 2)).tolist():
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
