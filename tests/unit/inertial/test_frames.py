"""Frames and poses against matrices written out by hand."""

import lots
import numpy as np
from each import each

from inertial import frames, poses


def test_forces_are_products_of_right_handed_rotations():
    for plan, up in (("fibonacci", (0.0, 0.0, 1.0)), ("six", (1e-3, -2e-3, 1.0))):
        angles = lots.directions(plan)
        np.testing.assert_allclose(frames.force_from_angles(*angles.T, up), lots.force(angles, up), atol=1e-15)
    np.testing.assert_allclose(frames.rotation_x(np.pi / 2) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(frames.rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)


def test_angles_turn_gravity_back_along_any_direction(rng):
    wanted = rng.normal(size=(50, 3))
    wanted /= np.linalg.norm(wanted, axis=1, keepdims=True)
    np.testing.assert_allclose(frames.force_from_angles(*frames.angles_from_force(wanted)), wanted, atol=1e-12)


@each(["six", "nine", "twelve", "eighteen", "twenty_six", "fibonacci24", "orthogonal24"])
def test_named_plans_have_their_poses_on_the_sphere(name):
    angles = np.radians(poses.plan(name))
    counts = {"six": 6, "nine": 9, "twelve": 12, "eighteen": 18, "twenty_six": 26}
    assert angles.shape == (counts.get(name, 24), 2)
    force = frames.force_from_angles(angles[:, 0], angles[:, 1])
    np.testing.assert_allclose(np.linalg.norm(force, axis=1), 1.0, atol=1e-12)
    if name != "nine":  # six faces and three edges lean to one side by design
        np.testing.assert_allclose(force.mean(axis=0), 0.0, atol=2e-3)


def test_orthogonal24_has_every_face_up_four_times():
    force = frames.force_from_angles(*np.radians(poses.plan("orthogonal24")).T)
    _, counts = np.unique(np.round(force) + 0.0, axis=0, return_counts=True)
    assert counts.tolist() == [4] * 6
