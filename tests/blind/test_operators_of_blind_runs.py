"""The operators with memory, the geometry and the noise behave as their physics says."""

import numpy as np
import pytest
from scipy.signal import welch
from scipy.spatial.transform import Rotation
from truth.chain import specific_force
from truth.memory import lag, play, preisach, relaxation
from truth.noise import flicker_series
from truth.physics import Table
from truth.poses import PLANS

UP = np.array([0.0, 0.0, 1.0])


def test_force_follows_the_two_rotations_of_the_table():
    outer, inner = np.radians([[30.0, 75.0, -120.0], [10.0, 200.0, 45.0]])
    force = specific_force(Table(outer, inner, UP), 1)[0]
    expected = [
        (Rotation.from_euler("x", a) * Rotation.from_euler("z", b)).inv().apply(UP)
        for a, b in zip(outer, inner, strict=True)
    ]
    assert np.allclose(force, expected)


@pytest.mark.parametrize("plan", list(PLANS))
def test_poses_bring_up_where_they_say(plan):
    outer, inner = np.radians(PLANS[plan]).T
    assert np.allclose(np.linalg.norm(specific_force(Table(outer, inner, UP), 1)[0], axis=1), 1.0)


def test_lag_of_a_ramp_falls_behind_by_its_time_constant():
    ramp = np.arange(4000.0) * 5.0
    assert (ramp - lag(ramp, 120.0, 5.0))[-1] == pytest.approx(120.0, rel=0.03)


def test_play_forgets_the_way_but_not_the_side():
    way = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(1.0, 0.3, 50)])
    assert play(way, 0.1)[49] == pytest.approx(0.9)
    assert play(way, 0.1)[-1] == pytest.approx(0.4)


def test_preisach_loop_closes_and_has_an_area():
    up = np.linspace(-1.0, 1.0, 200)
    way = np.concatenate([up, up[::-1], up])
    out = preisach(way[None], -0.95, 0.95)[0]
    assert out[200] == pytest.approx(out[-1])
    assert out[300] - out[500] > 0.2


def test_relaxation_dies_out_after_the_move():
    force = np.zeros((1, 2, 3))
    force[0, :, 0] = 1.0
    left = relaxation(
        force, np.zeros((1, 3)), np.array([0.0, 0.0]), np.array([10.0, 10.0]), np.array([60.0, 60.0]), np.array([20.0])
    )
    assert left[0, 0, 0] == pytest.approx(2.0 * (1.0 - np.exp(-0.5)))
    assert left[0, 1, 0] == pytest.approx(left[0, 0, 0] * np.exp(-3.0))


@pytest.mark.parametrize("fractional", [True, False])
def test_flicker_has_a_spectrum_that_falls_as_one_over_f(fractional):
    series = flicker_series(np.random.default_rng(1), 64, 4096, fractional=fractional)
    frequency, power = welch(series, nperseg=2048)
    band = (frequency > 0.004) & (frequency < 0.1)
    slope = np.polyfit(np.log(frequency[band]), np.log(power.mean(axis=0)[band]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)
