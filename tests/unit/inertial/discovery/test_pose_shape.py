"""Free functions of the pose: orthogonal over the sphere, and what they leave of a linear model."""

import numpy as np
import pytest

from inertial.discovery.pose_shape import COUNT, harmonics, map_of
from inertial.frames import angles_from_force, force_from_angles


def sphere(n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Directions (n², 3) and their shares of the sphere: Gauss's points in height, even ones around."""
    z, weight = np.polynomial.legendre.leggauss(n)
    around = 2.0 * np.pi * np.arange(n) / n
    across = np.sqrt(1.0 - z**2)
    directions = np.stack(
        np.broadcast_arrays(across[:, None] * np.cos(around), across[:, None] * np.sin(around), z[:, None]), -1
    )
    return directions.reshape(-1, 3), np.repeat(weight / (2.0 * n), n)


def test_functions_are_orthogonal_of_rms_one_and_without_bias_scale_and_misalignment() -> None:
    directions, share = sphere()
    columns = np.column_stack([np.ones(len(directions)), directions * np.sqrt(3.0), harmonics(directions)])
    assert columns.T * share @ columns == pytest.approx(np.eye(4 + COUNT), abs=1e-12)
    assert harmonics(0.3 * directions) == pytest.approx(harmonics(directions))
    assert not harmonics(np.zeros((2, 3))).any()


def test_angles_are_those_of_the_table() -> None:
    directions, _ = sphere(6)
    assert force_from_angles(*angles_from_force(2.0 * directions)) == pytest.approx(directions, abs=1e-12)


@pytest.mark.slow
def test_a_map_is_a_function_of_degree_four_less_what_a_linear_model_takes() -> None:
    directions, share = sphere(8)
    function = directions[:, 0] ** 2 * directions[:, 1]
    size = harmonics(directions).T @ (share * function)
    twist = np.diag(np.linspace(1.0, 2.0, COUNT) * 1e-6)
    left, error = map_of(directions, size, twist)
    linear = np.column_stack([np.ones(len(directions)), directions])
    assert left == pytest.approx(function - linear @ np.linalg.lstsq(linear, function, rcond=None)[0], abs=1e-12)
    drawn = np.random.default_rng(4).multivariate_normal(np.zeros(COUNT), twist, 4000)
    scatter = np.std([map_of(directions, one, twist)[0] for one in drawn], axis=0)
    assert error == pytest.approx(scatter, rel=0.08)
