"""Closed forms and sphere fit return what went in, and refuse what cannot be determined."""

import numpy as np
import pytest

from inertial.errors import NotIdentified
from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.fits.ferraris import faces, ferraris
from inertial.fits.polynomial import fit_axis_polynomial, fit_temperature_curve
from inertial.fits.six_position import six_position
from inertial.static_intervals import find

K = np.array([[101.0, 0.4, -0.7], [0.0, 99.0, 0.3], [0.0, 0.0, 102.5]])
BIAS = np.array([3.0, -12.0, 0.5])
FACES = np.concatenate([np.eye(3), -np.eye(3)])


def directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    f = rng.normal(size=(*shape, 3))
    return f / np.linalg.norm(f, axis=-1, keepdims=True)


def test_six_positions_return_bias_scale_and_response() -> None:
    g = 1.0017
    out = FACES * g @ K.T + BIAS
    calibration = six_position(out[:3], out[3:], g)
    np.testing.assert_allclose(calibration.bias, BIAS, atol=1e-12)
    np.testing.assert_allclose(calibration.response, K, atol=1e-12)
    np.testing.assert_allclose(calibration.scale_error(100.0), [0.01, -0.01, 0.025], atol=1e-12)
    np.testing.assert_allclose(calibration.apply(out), FACES * g, atol=1e-12)


def test_six_positions_are_found_for_a_batch() -> None:
    up = np.stack([np.eye(3) @ K.T + BIAS, 2.0 * np.eye(3) @ K.T - BIAS])
    down = np.stack([-np.eye(3) @ K.T + BIAS, -2.0 * np.eye(3) @ K.T - BIAS])
    np.testing.assert_allclose(six_position(up, down, 1.0).bias, [BIAS, -BIAS], atol=1e-12)


def test_ferraris_and_least_squares_agree_on_perfect_faces() -> None:
    out = FACES * 9.81 @ K.T + BIAS
    published, better = ferraris(out[:3], out[3:], 9.81), faces(out[:3], out[3:], 9.81)
    np.testing.assert_allclose(published.scale @ published.rotation, K, atol=1e-12)
    np.testing.assert_allclose(better.response, K, atol=1e-12)
    np.testing.assert_allclose(better.bias, published.bias, atol=1e-12)
    assert np.all(better.rms < 1e-10)


def test_a_second_order_term_shows_as_lack_of_fit_of_the_faces() -> None:
    out = FACES @ K.T + BIAS + 0.5 * FACES**2
    assert np.all(faces(out[:3], out[3:], 1.0, np.full(3, 0.01)).p_value < 1e-6)


def test_the_sphere_fit_returns_a_batch_of_units_without_noise(rng: np.random.Generator) -> None:
    f = directions(rng, 5, 24)
    scale = 1.0 + 0.01 * np.arange(5)[:, None, None]
    fit = fit_ellipsoid(f @ K.T * scale + BIAS, norm=1.0)
    np.testing.assert_allclose(fit.response, K * scale, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(fit.bias, np.broadcast_to(BIAS, (5, 3)), rtol=1e-7)
    assert np.all(fit.rms < 1e-9)


def test_the_sphere_fit_does_not_care_how_the_fixture_is_turned(rng: np.random.Generator) -> None:
    f = directions(rng, 30)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    noise = 0.01 * rng.normal(size=(30, 3))
    one, other = fit_ellipsoid(f @ K.T + BIAS + noise), fit_ellipsoid(-(f @ K.T + BIAS + noise) @ turn.T)
    assert float(one.rms) == pytest.approx(float(other.rms), rel=1e-6)


def test_the_sphere_fit_finds_the_temperature_offset(rng: np.random.Generator) -> None:
    f, heat = directions(rng, 60), rng.uniform(-20.0, 60.0, 60)
    offset = np.array([0.02, -0.05, 0.01])
    fit = fit_ellipsoid(f @ K.T + BIAS + (heat - heat.mean())[:, None] * offset, temperature=heat)
    np.testing.assert_allclose(fit.temperature_offset, offset, rtol=1e-6)


def test_pulls_of_the_sphere_fit_are_standard_normal() -> None:
    rng = np.random.default_rng(17)
    f = np.broadcast_to(directions(rng, 40), (400, 40, 3))
    fit = fit_ellipsoid(f @ K.T + BIAS + 0.05 * rng.normal(size=(400, 40, 3)))
    pulls = (fit.bias - BIAS) / np.sqrt(np.diagonal(fit.covariance, axis1=-2, axis2=-1)[:, :3])
    assert np.all(np.abs(pulls.mean(axis=0)) < 0.15)
    assert np.all(np.abs(pulls.std(axis=0) - 1.0) < 0.1)


def test_the_sphere_fit_refuses_poses_that_never_leave_a_plane() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    f = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(24)])
    with pytest.raises(NotIdentified, match=r"output z never changes|undetermined"):
        fit_ellipsoid(f @ K.T + BIAS)


def test_the_sphere_fit_refuses_fewer_dwells_than_unknowns(rng: np.random.Generator) -> None:
    with pytest.raises(NotIdentified, match="9 dwells, more than 9"):
        fit_ellipsoid(directions(rng, 9))


def test_the_axis_polynomial_returns_its_coefficients(rng: np.random.Generator) -> None:
    out, heat = rng.uniform(-2.0, 2.0, (4, 30, 3)), rng.uniform(0.0, 50.0, (4, 30))
    c = np.array([0.1, 0.9, -0.02, 0.003])
    force = sum(c[k] * out**k for k in range(4)) + 1e-3 * (heat - 25.0)[..., None]
    fit = fit_axis_polynomial(out, force, temperature=heat)
    np.testing.assert_allclose(fit.coefficients, np.broadcast_to([*c, 1e-3], (4, 3, 5)), atol=1e-10)
    np.testing.assert_allclose(fit.apply(out, heat), force, atol=1e-10)


def test_the_axis_polynomial_refuses_too_few_levels() -> None:
    out = np.tile(np.array([[-1.0], [0.0], [1.0]]), (4, 3))
    with pytest.raises(NotIdentified, match="do not determine degree 3"):
        fit_axis_polynomial(out, out)


def test_a_cubic_that_is_true_is_adequate(rng: np.random.Generator) -> None:
    heat = np.linspace(-20.0, 60.0, 2000)
    truth = 9.8 + 1e-3 * heat - 2e-6 * heat**2 + 3e-7 * heat**3
    fit = fit_temperature_curve(truth[:, None] + 0.003 * rng.normal(size=(2000, 3)), heat)
    assert fit.adequate
    powers = (heat[:, None] - fit.reference_temperature) ** np.arange(4)
    np.testing.assert_allclose(powers @ fit.coefficients[0], truth, atol=5e-4)


def test_a_rate_term_is_not_adequate(rng: np.random.Generator) -> None:
    heat = 20.0 + 40.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 2000))
    rate = np.gradient(heat)
    output = 1e-3 * heat[:, None] + 0.1 * rate[:, None] + 0.003 * rng.normal(size=(2000, 3))
    assert not fit_temperature_curve(output, heat).adequate


def test_static_intervals_are_those_that_were_made(rng: np.random.Generator) -> None:
    rate, still = 50.0, []
    parts = []
    for _ in range(8):
        still.append((sum(map(len, parts)), 400))
        parts += [np.tile(directions(rng), (400, 1)), 0.5 * rng.normal(size=(150, 3))]
    record = np.concatenate(parts) + 2e-3 * rng.normal(size=(8 * 550, 3))
    for scale in (1.0, 4e3):
        intervals = find(record * scale, rate)
        assert len(intervals) == 8
        for (start, length), a, b in zip(still, intervals.start, intervals.stop, strict=True):
            assert start <= a < start + 60
            assert start + length - 60 < b <= start + length


def test_a_record_that_never_moves_is_one_interval(rng: np.random.Generator) -> None:
    intervals = find(rng.normal(size=(5000, 3)), 100.0)
    assert (intervals.start.tolist(), intervals.stop.tolist()) == ([0], [5000])
