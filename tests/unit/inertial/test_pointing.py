"""The lot as an inclinometer: the table's errors are common to all units and square to the force; the units' own are not."""

import numpy as np
import pytest

from inertial import poses
from inertial.frames import force_from_angles
from inertial.pointing import POINTING_DEG, Pointing, contradicts, pointing_error


def lot(rng: np.random.Generator, force: np.ndarray, units: int = 6) -> np.ndarray:
    """Outputs (n, units, 3) in LSB of units with bias, scale, misalignment, a cubic term and noise of their own."""
    matrix = np.eye(3) + 5e-3 * rng.normal(size=(units, 3, 3))
    bias, cubic = 0.02 * rng.normal(size=(units, 3)), 3e-4 * rng.normal(size=(units, 3))
    out = np.einsum("uij,nj->nui", matrix, force) + bias + cubic * force[:, None, :] ** 3
    return 256000.0 * (out + 5e-5 * rng.normal(size=out.shape))


def plan(name: str = "fibonacci24") -> np.ndarray:
    return np.radians(poses.plan(name))


def force_of(angles: np.ndarray) -> np.ndarray:
    return force_from_angles(*angles.T)


def test_units_with_errors_of_their_own_and_too_few_dwells_accuse_nobody(rng: np.random.Generator) -> None:
    force = force_of(plan())
    assert pointing_error(force, lot(rng, force)) < 0.02
    few = force_of(plan("six")[:5])
    assert pointing_error(few, lot(rng, few[::-1])) == 0.0
    assert contradicts(POINTING_DEG) == ""


@pytest.mark.parametrize("name", ["fibonacci24", "twelve", "nine"])
def test_a_zero_lost_half_way_is_seen_by_all(rng: np.random.Generator, name: str) -> None:
    angles = plan(name)
    true = angles.copy()
    true[len(true) // 2 :, 0] += np.radians(1.0)
    error = pointing_error(force_of(angles), lot(rng, force_of(true)))
    assert error > 2.0 * POINTING_DEG
    assert "check zero and gears" in contradicts(error)


def test_the_angle_is_that_of_the_table(rng: np.random.Generator) -> None:
    angles = plan()
    force = force_of(angles)
    turned = angles + np.radians(0.3) * rng.normal(size=angles.shape)  # each dwell off by its own angle
    true = force_of(turned)
    off = np.degrees(np.sqrt(np.mean(np.sum(np.cross(force, true) ** 2, axis=1)) / 2.0))
    assert pointing_error(force, lot(rng, true)) == pytest.approx(off, rel=0.35)


def test_a_soak_is_judged_by_its_own_dwells(rng: np.random.Generator) -> None:
    angles, watched = poses.plan("nine"), Pointing()
    force = force_of(plan("nine"))
    for soak in (0, 1):  # what the units do at another temperature is their own matter
        output = lot(np.random.default_rng(soak), force)
        for dwell, pose in enumerate(angles):
            means = {f"U{unit}": output[dwell, unit] for unit in range(4 if dwell < 6 else 3)}
            error = watched.add(soak, (float(pose[0]), float(pose[1])), means)
    assert len(watched.means) == len(angles)
    assert error < POINTING_DEG
