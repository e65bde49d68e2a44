"""A device turned in gravity: what is put in comes out, delay by both directions, honest uncertainties, effects by name."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from long_suites import mostly_slow
from scipy.stats import binom

from inertial.dynamics.rotation import RotationData
from inertial.dynamics.rotation_diagnosis import diagnose_rotation
from inertial.dynamics.rotation_effects import EFFECTS
from inertial.dynamics.rotations import Nodes, Rotations, mean
from inertial.dynamics.turn_record import fit_sweep, parts_of
from inertial.errors import NotIdentified

WHITE, RATE, BINS = 1e-5, np.radians(24.0), 36
PLANES = {"xy": (True, np.pi / 2), "yz": (False, 0.0), "xz": (False, np.pi / 2)}
BIAS = np.array([4e-3, -2e-3, 1e-3])
MATRIX = np.array([[1.002, 3e-3, -1e-3], [2e-3, 0.999, 4e-3], [-2e-3, 1e-3, 1.001]])
K2, K3, PLACE = np.array([[2e-4, -1e-4, 3e-4], [-3e-4, 2e-4, 1e-4], [0.04, -0.02, 0.015]])
DELAY = 6e-3


def rotations(planes: Iterable[str] = PLANES, rates: Sequence[float] = (RATE,)) -> Rotations:
    """Each plane forward and back, at rest between."""
    rows, now, sweep, span = [], 0.0, 0, 2.0 * np.pi / BINS
    for plane in planes:
        own, other = PLANES[plane]
        for rate, sign in product(rates, (1.0, -1.0)):
            rows.append((-sign * 1.1 * np.pi, other, own, 0.0, 0.0, now, -1))
            now += 2.0
            for k in range(BINS):
                rows.append((sign * ((k + 0.5) * span - np.pi), other, own, span, sign * rate, now, sweep))
                now += span / rate
            sweep += 1
        rows.append((-1.1 * np.pi, other, own, 0.0, 0.0, now, -1))
        now += 10.0
    angle, still, turned, width, rate, time, number = np.array(rows, dtype=float).T
    outer, inner = np.where(turned > 0, (still, angle), (angle, still))
    uncertain = np.zeros((len(time), 6))
    uncertain[number >= 0, 0] = 1e-5
    return Rotations(outer, inner, turned, width, rate, np.zeros(time.size), time, number.astype(int), uncertain)


INSTANTS = (np.arange(200) + 0.5) / 200.0 - 0.5
"""Of a point, in parts of its span: what is true is averaged over them, not by the nodes of the model."""


def angles(points: Rotations, step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outer and inner angle (n,) where the axis that turns has gone on by a step (n,)."""
    own = points.inner_turns > 0
    return points.outer + np.where(own, 0.0, step), points.inner + np.where(own, step, 0.0)


def gravity(points: Rotations, step: np.ndarray) -> np.ndarray:
    """Force (n, 3) in the fixture there, written out."""
    o, i = angles(points, step)
    return np.stack([np.sin(i) * np.sin(o), np.cos(i) * np.sin(o), np.cos(o)], axis=1)


def low_passed(points: Rotations, lag: float) -> np.ndarray:
    """Means (n, 3) of gravity behind y' = (f - y)/lag, as the integral of its impulse response over the time before."""
    before, weights = np.polynomial.laguerre.laggauss(20)  # in time constants, weighed with exp(-before)
    past = [weight * gravity(points, points.span * part - points.rate * lag * time)
            for part in INSTANTS for time, weight in zip(before, weights, strict=True)]  # fmt: skip
    return np.sum(past, axis=0) / len(INSTANTS)


def true_output(points: Rotations) -> np.ndarray:
    """Means of the output over each point."""
    total = np.zeros((len(points.time), 3))
    for part in INSTANTS:
        step = points.span * part + points.rate * DELAY
        (_, i), own = angles(points, step), points.inner_turns > 0
        force = gravity(points, step)
        about = np.where(own[:, None], [0.0, 0.0, 1.0], np.stack([np.cos(i), -np.sin(i), 0.0 * i], axis=1))
        inward = about * (about @ PLACE)[:, None] - PLACE
        felt = force + points.rate[:, None] ** 2 * inward / 9.80665
        total += BIAS + felt @ MATRIX.T + K2 * felt**2 + K3 * felt**3
    return total / len(INSTANTS)


def data(points: Rotations, output: np.ndarray, rng: np.random.Generator) -> RotationData:
    noisy = output + WHITE * rng.standard_normal(output.shape)
    return RotationData(points, noisy, np.full(output.shape, WHITE), tuple("xyz"[: output.shape[1]]))


BY_AXIS = {"bias": BIAS, "second_order": K2, "third_order": K3, "place": PLACE}
TRUTH = {
    **{f"{name}_{axis}": value[i] for name, value in BY_AXIS.items() for i, axis in enumerate("xyz")},
    **{f"matrix_{a}{b}": MATRIX[i, j] for i, a in enumerate("xyz") for j, b in enumerate("xyz")},
    **dict.fromkeys(("delay_outer", "delay_inner"), DELAY),
}


def test_what_is_put_in_comes_out_and_is_adequate() -> None:
    points = rotations()
    made = diagnose_rotation(data(points, true_output(points), np.random.default_rng(3)))
    assert made.adequate
    assert not made.classes
    pulls = [(made.fit.of(name)[0] - true) / made.fit.of(name)[1] for name, true in TRUTH.items()]
    assert np.max(np.abs(pulls)) < 4.0
    assert made.fit.of("matrix_xx")[1] < 2e-5


def test_both_directions_tell_a_delay_from_an_angle_that_is_off() -> None:
    """A seat that is turned by rate times delay looks the same in one direction; in the other it is opposite."""
    points, rng = rotations(planes=["xy", "yz"]), np.random.default_rng(4)
    seat = RATE * DELAY
    turned = np.array([[np.cos(seat), np.sin(seat), 0.0], [-np.sin(seat), np.cos(seat), 0.0], [0.0, 0.0, 1.0]])
    output = BIAS + low_passed(points, 0.0) @ turned.T  # no delay, a turned seat
    fit = data(points, output, rng).model.fit(("second_order", "third_order"))
    true = {"delay_inner": 0.0, "delay_outer": 0.0, "matrix_xy": np.sin(seat), "matrix_yx": -np.sin(seat)}
    for name, value in true.items():
        assert abs(fit.of(name)[0] - value) < 4.0 * fit.of(name)[1]
    assert fit.of("delay_inner")[1] < 1e-4


def test_a_low_pass_shows_as_gain_over_the_rate_and_as_delay() -> None:
    """Gravity turns as one phasor: of a time constant τ its gain is 1/√(1 + (ωτ)²), its phase −arctan(ωτ), about ωτ."""
    lag, rates = 0.05, (0.4 * RATE, RATE)
    points, rng = rotations(planes=["xy", "yz"], rates=rates), np.random.default_rng(41)
    output = BIAS + low_passed(points, lag) @ MATRIX.T
    made = diagnose_rotation(data(points, output, rng))
    assert not made.adequate
    assert "rate_gain" in made.classes[0].effects
    fit = data(points, output, rng).model.fit(("second_order", "third_order", "rate_gain"))
    for axis in "xyz":
        value, u = fit.of(f"rate_gain_{axis}")
        assert abs(value - (1.0 / np.sqrt(1.0 + (RATE * lag) ** 2) - 1.0)) < 4.0 * u
        assert u < 2e-5
    assert abs(fit.of("delay_inner")[0] + lag) < 4.0 * fit.of("delay_inner")[1]


def test_parts_of_a_turn_of_unequal_length_are_no_noise() -> None:
    """Bins of 41 and 42 samples average a wave by 60 µg more or less, which is thirty times this noise."""
    points = rotations()
    uneven = replace(points, span=points.span * np.where(np.arange(points.time.size) % 3 == 2, 0.976, 1.0))
    made = diagnose_rotation(data(uneven, true_output(uneven), np.random.default_rng(11)))
    assert made.adequate
    assert 0.7 < made.fit.chi_square / made.fit.dof < 1.35


def test_planes_that_leave_an_axis_still_and_too_few_readings_are_refused() -> None:
    points = rotations(planes=["xy"])
    with pytest.raises(NotIdentified, match="turn another plane"):
        diagnose_rotation(data(points, true_output(points), np.random.default_rng(5)))
    with pytest.raises(NotIdentified, match="readings of the encoder"):
        fit_sweep(np.arange(20.0), np.arange(20.0), 0.0, 2.0 * np.pi)


@pytest.mark.slow
def test_uncertainties_hold_in_coloured_noise() -> None:
    points = rotations(planes=["xy", "yz"])
    clean, rng = true_output(points), np.random.default_rng(6)
    names = [name for name in TRUTH if name.startswith(("matrix", "second", "third", "place"))]
    held = total = 0
    for _ in range(12):
        tau = np.geomspace(0.3, 300.0, 9)
        state, drift, last = 5e-5 * rng.standard_normal((9, 3)), [], points.time[0]
        for now in points.time:
            keep = np.exp(-(now - last) / tau)[:, None]
            state = keep * state + 5e-5 * np.sqrt(1.0 - keep**2) * rng.standard_normal((9, 3))
            drift.append(state.sum(axis=0))
            last = now
        fit = data(points, clean + np.array(drift), rng).model.fit(("second_order", "third_order"))
        held += sum(abs(fit.of(n)[0] - TRUTH[n]) <= 2.0 * fit.of(n)[1] for n in names)
        total += len(names)
    assert binom.ppf(1e-4, total, 0.93) / total <= held / total


@pytest.mark.parametrize(
    "effect", mostly_slow(sorted(set(EFFECTS) - {"second_order", "third_order"}), "odd_quadratic", "asymmetry")
)
def test_a_term_that_the_model_lacks_is_named_in_its_class(effect: str) -> None:
    """The term itself at a size well above the noise; mechanisms of the plant are in benchmarks/rotation.py."""
    points = rotations()
    term = mean(EFFECTS[effect].columns(Nodes.of(points.later(np.full(2, DELAY)))))
    term = term.sum(axis=-1) if term.ndim == 3 else term
    size = 4e-3 if effect == "odd_quadratic" else 4e-4  # of which K3 takes up most
    by_axis = 1.0 if EFFECTS[effect].of_table else np.array([1.0, -0.6, 0.8])
    added = size * term * by_axis / max(1.0, np.abs(term).max())
    made = diagnose_rotation(data(points, true_output(points) + added, np.random.default_rng(7)))
    assert made.adequate is False
    assert effect in made.classes[0].effects
    assert not made.unexplained


@pytest.mark.slow
def test_one_rate_leaves_lag_and_hysteresis_together_and_a_second_one_parts_them() -> None:
    named = []
    for rates in ((RATE,), (RATE, 0.5 * RATE)):
        points = rotations(rates=rates)
        lag = -2e-3 * mean(EFFECTS["lag_of_axes"].columns(Nodes.of(points))) * np.array([1.0, 0.0, 0.0])
        made = diagnose_rotation(data(points, true_output(points) + lag, np.random.default_rng(8)))
        named.append(set(made.classes[0].effects))
        assert any("another rate" in step for step in made.next_steps) == (len(rates) == 1)
    assert {"lag_of_axes", "hysteresis"} <= named[0]
    assert "hysteresis" not in named[1]


def readings(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A turn forward and back with ripple, read every 50 ms, 5 ± 0.5 ms late."""
    time = np.arange(0.0, 42.0, 0.05)
    seen = time - 5e-3 - 5e-4 * rng.standard_normal(time.size)
    there = 400.0 / 24.0
    angle = np.interp(seen, [1.0, 1.0 + there, 4.0 + there, 4.0 + 2.0 * there], [-200.0, 200.0, 200.0, -200.0])
    ripple = 0.05 * np.sin(np.radians(angle)) + 0.03 * np.cos(np.radians(30.0 * angle))
    return time, np.radians(angle + np.where(np.abs(np.abs(angle) - 200.0) > 1e-9, ripple, 0.0))


def test_a_record_of_turns_gives_rate_ripple_and_standing_times() -> None:
    time, angle = readings(np.random.default_rng(9))
    sweeps, still = parts_of(time, angle, np.radians([-200.0, 200.0, -200.0]).tolist(), 1, 1.0)
    assert [np.degrees(one.rate) for one in sweeps] == pytest.approx([24.0, -24.0], abs=5e-3)
    assert all({1, 2, 30} <= set(one.orders) for one in sweeps)
    assert np.degrees(sweeps[0].scatter) == pytest.approx(24.0 * 5e-4, rel=0.25)
    assert sweeps[0].end - sweeps[0].begin == pytest.approx(15.0, abs=0.02)
    assert np.degrees(still[:, 2]) == pytest.approx([-200.0, 200.0, -200.0], abs=1e-3)
    at = np.linspace(sweeps[0].begin, sweeps[0].end, 2001)
    rate, acceleration = sweeps[0].motion(at)
    assert rate[1:-1] == pytest.approx(np.gradient(sweeps[0].angle(at), at)[1:-1], rel=1e-3)
    assert acceleration[1:-1] == pytest.approx(np.gradient(rate, at)[1:-1], abs=2e-2 * np.abs(acceleration).max())


@pytest.mark.parametrize("count", [1, 2])
def test_a_device_with_fewer_axes_is_measured_too(count: int) -> None:
    points = rotations()
    made = diagnose_rotation(data(points, true_output(points)[:, :count], np.random.default_rng(12)))
    assert made.adequate
    pulls = {n: (made.fit.of(n)[0] - TRUTH[n]) / made.fit.of(n)[1] for n in TRUTH if n in made.fit.names}
    assert max(map(abs, pulls.values())) < 4.0, pulls
