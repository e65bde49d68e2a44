"""Errors of velocity and position against noise that is integrated twice, and against the figures of a worked example."""

import numpy as np
import pytest

from inertial.noise.navigation import PER_G, navigation_error

DT_S, TIME_S, RECORDS = 0.1, 60.0, 4000


def integrated(acceleration):
    velocity = np.cumsum(acceleration, axis=1) * DT_S
    return velocity[:, -1].std(), (np.cumsum(velocity, axis=1) * DT_S)[:, -1].std()


@pytest.mark.parametrize("term", ["N", "B", "K"])
def test_the_errors_are_those_of_integrated_noise(term):
    rng, n = np.random.default_rng(20_261), round(TIME_S / DT_S)
    white = rng.standard_normal((RECORDS, n))
    made = {
        "N": 2.0 * white / np.sqrt(DT_S),  # σ(τ) = N/√τ
        "B": np.repeat(2.0 * white[:, :1], n, axis=1),
        "K": 2.0 * np.cumsum(white, axis=1) * np.sqrt(DT_S),
    }[term]
    got = navigation_error({term: 2.0}, "m/s^2", np.array([TIME_S]))
    velocity, position = integrated(made)
    assert got.velocity[0] == pytest.approx(velocity, rel=0.05)
    assert got.position[0] == pytest.approx(position, rel=0.05)


def test_velocity_random_walk_is_sixty_times_the_density():
    # 25 µg/√Hz, the ADXL355 of the notes: 25e-6 · 9.80665 · 60 = 0.0147 m/s/√h
    got = navigation_error({"N": 25.0, "B": 20.0, "K": None}, "µg", np.array([3600.0]))
    assert got.velocity_random_walk == pytest.approx(0.01471, rel=1e-3)
    assert got.q_n == pytest.approx((25e-6 * PER_G) ** 2)
    assert got.q_b == pytest.approx((20e-6 * PER_G) ** 2)
    assert got.velocity[0] == pytest.approx(np.hypot(0.01471, 20e-6 * PER_G * 3600.0), rel=1e-3)
