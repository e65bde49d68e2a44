"""The shift of bias and scale by an exposure: true shifts are found, none is within U, and too few records are refused."""

import numpy as np
import pytest

from inertial.dynamics.exposure import ExposureShift, exposure_shift, temperature_slope
from inertial.dynamics.stability import ShortNoise
from inertial.errors import NotIdentified

FACES = np.vstack([sign * np.eye(3)[k] for k in range(3) for sign in (1.0, -1.0)])
QUIET = ShortNoise(0.0, 0.0, 0.0)
WHITE = 20.0


def shifted(rng: np.random.Generator, bias: float, scale: float, repeats: int = 2) -> ExposureShift:
    force = np.tile(FACES, (2 * repeats, 1))
    after = np.repeat([False, True], len(force) // 2)
    output = 500.0 + force @ np.array([1e6, 3000.0, -2000.0]) + after * (bias + scale * force[:, 0])
    noisy = output + WHITE * rng.standard_normal(len(force))
    return exposure_shift(force, noisy, after, 0, QUIET, 300.0, 7200.0)


def test_shifts_are_found_and_u_holds_them() -> None:
    rng = np.random.default_rng(11)
    found = [shifted(rng, 300.0, -150.0) for _ in range(400)]
    for name, true in (("bias", 300.0), ("scale", -150.0)):
        values = [getattr(one, name) for one in found]
        assert 0.92 < np.mean([abs(one.value - true) < 2.0 * one.u for one in values]) < 0.985, name
    assert np.mean([one.bias.value for one in found]) == pytest.approx(300.0, abs=3.0)


def test_flicker_between_the_groups_widens_the_bias_and_not_the_scale() -> None:
    force = np.tile(FACES, (4, 1))
    after = np.repeat([False, True], 12)
    output = force @ np.array([1e6, 0.0, 0.0]) + np.random.default_rng(2).standard_normal(24)
    calm, wild = (
        exposure_shift(force, output, after, 0, ShortNoise(0.0, flicker, 0.3 * flicker), 300.0, 7200.0)
        for flicker in (0.0, 100.0**2)
    )
    assert wild.bias.u > 100.0
    assert calm.bias.u < 10.0
    assert wild.scale.u == calm.scale.u


def test_one_pass_of_six_poses_is_refused() -> None:
    force = np.tile(FACES[:5], (2, 1))
    with pytest.raises(NotIdentified, match="10 records for 8 unknowns, 12 in six poses are needed; raise repeats"):
        exposure_shift(force, np.zeros(10), np.repeat([False, True], 5), 0, QUIET, 300.0, 7200.0)


def test_a_slope_is_that_at_the_temperature_and_needs_poses_at_three_temperatures() -> None:
    rng = np.random.default_rng(6)
    force = np.tile(FACES, (4, 1))
    at = np.repeat([25.0, 25.0, -40.0, 85.0], 6) + 0.1 * rng.standard_normal(24)
    true = np.array([80.0, 200.0, -3.0, 0.0])
    own = np.column_stack([np.ones(24), force])
    found = []
    for _ in range(200):
        output = 1e6 * force[:, 0] + own @ true * (at - 25.0) + 0.5 * (at - 25.0) ** 2 + WHITE * rng.standard_normal(24)
        slope = temperature_slope(force, output, at, 25.0)
        found.append((slope.value - true) / slope.u)
    assert 0.85 < np.std(found) < 1.25
    assert abs(np.mean(found)) < 0.2
    with pytest.raises(NotIdentified, match="more than 1 K below and above it"):
        temperature_slope(force[:18], np.zeros(18), at[:18], 25.0)
    force[12:] = FACES[0]
    with pytest.raises(NotIdentified, match="six poses are needed at the temperature of the test"):
        temperature_slope(force, np.zeros(24), at, 25.0)
