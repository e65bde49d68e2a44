"""A lot that is solved some units at a time, with the coefficients that each unit has by itself."""

import numpy as np
import pytest

from inertial import poses
from inertial.errors import NotIdentified
from inertial.fits import linear
from inertial.fits.linear import felt_force, fit_lot
from inertial.fits.normal_equations import inverses
from inertial.frames import force_from_angles
from inertial.state import State

EFFECTS = ("bias", "scale", "misalignment", "bias_temperature", "bias_temperature_quadratic", "scale_temperature")
UNITS = 2 * linear._PIECE + 7


def lot(rng: np.random.Generator) -> tuple[State, np.ndarray, np.ndarray]:
    """Two pieces and some units: one plan, each unit with its own temperatures and weights."""
    angles = np.radians(poses.plan("fibonacci24"))
    force = np.tile(force_from_angles(angles[:, 0], angles[:, 1]), (3, 1))
    heat = np.repeat([-20.0, 25.0, 60.0], 24) + rng.normal(scale=0.5, size=(UNITS, 72))
    k = np.eye(3) + 3e-3 * rng.normal(size=(UNITS, 3, 3))
    out = np.einsum("uij,nj->uni", k, force) + 5e-5 * heat[..., None] + 1e-5 * rng.normal(size=(UNITS, 72, 3))
    return State(force=force, time=np.arange(72.0), temperature=heat), out, rng.uniform(1e-5, 3e-5, out.shape)


@pytest.mark.parametrize("weights", ["alike", "by dwell"])
def test_units_in_pieces_are_the_units_alone(rng: np.random.Generator, weights: str) -> None:
    state, out, error = lot(rng)
    weighted = weights == "by dwell"
    fit = fit_lot(EFFECTS, state, out, error if weighted else None)
    for unit in (0, linear._PIECE - 1, linear._PIECE, UNITS - 1):
        heat = np.asarray(state.temperature)[unit]
        alone = fit_lot(
            EFFECTS,
            State(force=state.force, time=state.time, temperature=heat),
            out[unit],
            error[unit] if weighted else None,
        )
        for name in ("coefficients", "covariance", "residuals", "chi2", "dof"):
            one, other = getattr(fit, name)[unit], getattr(alone, name)
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())
        theta, f = heat - 25.0, state.force
        along = felt_force(f, out[unit], theta)
        for axis in range(3):
            j, k = (axis + 1) % 3, (axis + 2) % 3
            columns = [np.ones(72), f[:, axis], f[:, j], f[:, k], theta, theta**2, theta * along[:, axis]]
            weight = 1.0 / error[unit, :, axis] if weighted else np.ones(72)
            plain = np.linalg.lstsq(np.array(columns).T * weight[:, None], out[unit, :, axis] * weight, rcond=None)[0]
            np.testing.assert_allclose(fit.coefficients[unit, axis], plain, rtol=1e-8, atol=1e-12)


def test_a_plan_that_confuses_coefficients_is_refused_with_their_names_in_any_piece(rng: np.random.Generator) -> None:
    state, out, _ = lot(rng)
    heat = np.array(state.temperature)
    heat[UNITS - 1] = 30.0
    with pytest.raises(NotIdentified, match="bias"):
        fit_lot(EFFECTS, State(force=state.force, time=state.time, temperature=heat), out)


@pytest.mark.parametrize("p", [1, 2, 9])
def test_inverses_of_many_matrices_are_those_of_each(rng: np.random.Generator, p: int) -> None:
    columns = rng.standard_normal((100, 3, 40, p)) * np.geomspace(1.0, 1e-3, p)
    gram = np.swapaxes(columns, -1, -2) @ columns
    np.testing.assert_allclose(inverses(gram), np.linalg.inv(gram), rtol=1e-9)


def test_one_singular_matrix_of_many_raises(rng: np.random.Generator) -> None:
    columns = rng.standard_normal((100, 40, 3))
    columns[7, :, 1] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        inverses(np.swapaxes(columns, -1, -2) @ columns)
