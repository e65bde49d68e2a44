"""What plans can see, against a published table: the part v of each term left after bias, scale and misalignment.

Computed for sensor axis x; the plans are symmetric, so every axis must show the same to two digits (one for the lattice).
Ageing, hysteresis and rate under orders of soaks, and the floors of coefficients, are from the same computation.
"""

from dataclasses import replace

import numpy as np
import pytest
from posed import posed

from inertial import effects, poses
from inertial.planning import visibility
from inertial.state import State

COLUMNS = (
    ("second_order", 0), ("cross_axis_quadratic", 0), ("cross_coupling", 0), ("cross_axis_quadratic", 2),
    ("third_order", 0), ("odd_quadratic", 0), ("scale_asymmetry", 0), ("bias_asymmetry", 0),
)  # fmt: skip
TABLE = {
    "six": (0.82, 0.82, 0, 0, 0, 0, 0.82, 0),
    "orthogonal24": (0.82, 0.82, 0, 0, 0, 0, 0.82, 0),
    "twelve": (0.58, 0.58, 1, 1, 0, 0, 0.58, 0),
    "eighteen": (0.71, 0.71, 1, 1, 0.33, 0.17, 0.68, 0.15),
    "twenty_six": (0.64, 0.64, 1, 1, 0.40, 0.21, 0.58, 0.18),
    "fibonacci24": (0.66, 0.67, 1, 1, 0.41, 0.25, 0.49, 0.47),
}
RANKS = {"six": (6, 6, 6), "orthogonal24": (6, 6, 6), "twelve": (9, 12, 12), "eighteen": (9, 15, 18),
         "twenty_six": (9, 16, 22), "fibonacci24": (9, 16, 24)}  # fmt: skip


def state_of(degrees):
    """Dwells in poses of these angles, 30 s apart at 25 °C."""
    return posed(degrees, 30.0, temperature=np.full(len(degrees), 25.0))


def monomials(force, degree):
    """All products of powers of the components up to a degree, (n, m)."""
    powers = [p for p in np.ndindex(*(degree + 1,) * 3) if sum(p) <= degree]
    return np.stack([np.prod(force ** np.array(p), axis=1) for p in powers], axis=1)


@pytest.mark.parametrize("name", TABLE)
def test_the_table_of_identifiability_and_the_ranks_of_polynomials_on_the_sphere_are_reproduced(name):
    state = state_of(poses.plan(name))
    for axis in range(3):
        base = np.concatenate([np.ones((len(state.time), 1)), state.force], axis=1)
        span = np.linalg.svd(base, full_matrices=False)[0]
        for (effect, column), expected in zip(COLUMNS, TABLE[name], strict=True):
            sharp = {"transition": 1e-5} if effect == "bias_asymmetry" else {}
            values = effects.get(effect).columns(state, axis, **sharp)[:, column]
            if np.linalg.norm(values) < 1e-9:
                assert expected == 0
                continue
            left = np.linalg.norm(values - span @ (span.T @ values)) / np.linalg.norm(values)
            assert left == pytest.approx(expected, abs=0.006 if axis == 0 else 0.035)
    for degree, expected in zip((2, 3, 4), RANKS[name], strict=True):
        assert np.linalg.matrix_rank(monomials(state.force, degree), tol=1e-8) == expected
    # the command tells the same part axis by axis
    ids = ("second_order", "third_order", "odd_quadratic", "scale_asymmetry", "cross_coupling")
    rows = {s.effect: s for s in visibility.visibilities(state, BASE, 1e-5, ids)}
    for (effect, _), expected in zip(COLUMNS, TABLE[name], strict=True):
        if effect in ids:
            by_axis = rows[effect].by_axis if rows[effect].seen else (0.0, 0.0, 0.0)
            assert by_axis == pytest.approx([expected] * 3, abs=0.035)


def test_second_order_terms_add_up_to_the_bias_and_third_order_ones_to_the_scale():
    state = state_of(poses.fibonacci(60))
    for axis in range(3):
        own = effects.get("second_order").columns(state, axis)[:, 0]
        across = effects.get("cross_axis_quadratic").columns(state, axis)[:, :2]
        assert own + across.sum(axis=1) == pytest.approx(np.ones(60))
        f = state.force
        assert (f**2).sum(axis=1) * f[:, axis] == pytest.approx(f[:, axis])


BASE = ("bias", "scale", "misalignment")
THERMAL = (*BASE, "bias_temperature", "scale_temperature")
FACES = ((90.0, 90.0), (90.0, -90.0), (90.0, 0.0), (90.0, 180.0), (0.0, 0.0), (180.0, 0.0))
RISING = (-20.0, 0.0, 20.0, 40.0, 60.0)
CLOSED = (*RISING, *RISING[-2::-1])
SOAK_S, DWELL_S = 1100.0, 20.0  # 15 min of soak and six faces, 20 s each with its move, then a reserve


def soaks(heat, angles=FACES):
    """Six faces at every soak; time from the middle of the run, so that its mean is the bias already."""
    state = state_of(np.tile(angles, (len(heat), 1)))
    time = (np.arange(len(heat))[:, None] * SOAK_S + np.arange(len(angles)) * DWELL_S).ravel()
    warm = np.repeat(heat, len(angles))
    return replace(state, time=time - time.mean(), temperature=warm, chamber=warm)


def left(state, base, column, axis=0):
    """Part of a column that a model leaves on one axis, written out here."""
    sensor = [effects.get(name) for name in base]
    h = np.concatenate([e.columns(state, axis) for e in sensor], axis=1)
    span = np.linalg.svd(h / np.linalg.norm(h, axis=0), full_matrices=False)[0]
    return np.linalg.norm(column - span @ (span.T @ column)) / np.linalg.norm(column)


def ageing_of(state):
    """What a plan sees of ageing, and of the ageing of the scale."""
    return visibility.visibilities(state, THERMAL, 1e-5, ["aging_linear", "scale_aging"])


def test_monotone_soaks_hide_ageing_as_far_as_published_soaks_up_and_down_show_all_and_shuffled_ones_most(rng):
    ageing, scale_ageing = (sight.remaining_fraction for sight in ageing_of(soaks(RISING)))
    assert ageing == pytest.approx(0.021, abs=0.001)
    assert scale_ageing == pytest.approx(0.005, abs=0.0005)
    for one in ageing_of(soaks(CLOSED)):
        assert one.by_axis == pytest.approx([1.0, 1.0, 1.0], abs=0.005)
    orders = [rng.permutation(CLOSED) for _ in range(60)]
    parts = [[sight.remaining_fraction for sight in ageing_of(soaks(order))] for order in orders]
    ageing, scale_ageing = np.mean(parts, axis=0)
    assert ageing == pytest.approx(0.93, abs=0.05)
    assert 0.86 - 0.03 < scale_ageing < 1.0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_hysteresis_shows_on_the_way_back_and_not_on_a_one_way_soak(axis):
    base = (*THERMAL, "bias_temperature_quadratic")
    for heat, expected in ((RISING, 0.0), (CLOSED, 1.0)):
        state = soaks(heat)
        at = (np.asarray(heat) - 20.0) / 40.0
        way = np.repeat(np.where(np.arange(len(heat)) < 5, 1.0, -1.0) * (1.0 - at**2), len(FACES))
        assert left(state, base, way, axis) == pytest.approx(expected, abs=0.005)


def test_the_catalogues_hysteresis_is_no_information_on_a_one_way_soak():
    """A play that is taken up within the first step stands at its edge from then on; where it stood before, nobody knows."""
    narrow = {"half_width": 1.0}
    for heat, low, high in ((RISING, 0.0, 1e-6), (CLOSED, 0.9, 1.0)):
        state = soaks(heat)
        effect = effects.get("thermal_hysteresis")
        column, start = effect.columns(state, 0, **narrow)[:, :1], effect.start_columns(state, 0, **narrow)
        plain = np.concatenate([np.ones((len(state.time), 1)), state.force], axis=1)
        span = np.linalg.svd(plain, full_matrices=False)[0]
        rest = visibility._after(span[None], column[None], start[None])
        assert low <= np.linalg.norm(rest) / np.linalg.norm(column) <= high


def test_a_ramp_in_one_pose_makes_the_rate_a_function_of_the_temperature():
    time = np.arange(0.0, 3600.0, 60.0)
    warm = 60.0 - 80.0 * np.exp(-time / 900.0)
    history = State(force=np.tile([0.0, 0.0, 1.0], (60, 1)), time=time, temperature=warm)
    rate = 60.0 * 80.0 / 900.0 * np.exp(-time / 900.0)
    assert left(history, ("bias", "bias_temperature"), rate, axis=2) == pytest.approx(0.0, abs=1e-9)
    late = replace(history, force=history.force[20:], time=time[20:], temperature=warm[20:])
    column = effects.get("thermal_rate").columns(history, 2, settling=30.0)[20:, 0]  # when the start has settled
    assert left(late, ("bias", "bias_temperature"), column, axis=2) == pytest.approx(0.0, abs=1e-9)


FLOORS = {
    ("six", "second_order"): 30.0, ("twenty_six", "second_order"): 24.0, ("six", "cross_coupling"): np.inf,
    ("twenty_six", "cross_coupling"): 25.0, ("six", "third_order"): np.inf, ("twenty_six", "third_order"): 47.0,
}  # fmt: skip


def test_three_sigma_floors_are_the_published_ones_also_under_the_same_noise_as_a_covariance():
    for (plan, effect), floor in FLOORS.items():
        (sight,) = visibility.visibilities(state_of(poses.plan(plan)), BASE, 11.4e-6, [effect])
        assert sight.seen == np.isfinite(floor), (plan, effect)
        assert 1e6 * sight.floor == pytest.approx(floor, rel=0.05), (plan, effect)
        n = len(state_of(poses.plan(plan)).time)
        (given,) = visibility.visibilities(
            state_of(poses.plan(plan)), BASE, 1.0, [effect], covariance=11.4e-6**2 * np.eye(n)
        )
        assert given.floor == pytest.approx(sight.floor)
