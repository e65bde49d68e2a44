"""Six positions, Ferraris, polynomials and the sphere fit return what went in, and refuse what cannot be determined."""

import numpy as np
import pytest

from inertial.errors import NotIdentified
from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.fits.faces import faces, ferraris
from inertial.fits.polynomial import fit_axis_polynomial, fit_temperature_curve

K = np.array([[101.0, 0.4, -0.7], [0.0, 99.0, 0.3], [0.0, 0.0, 102.5]])
BIAS = np.array([3.0, -12.0, 0.5])
FACES = np.concatenate([np.eye(3), -np.eye(3)])


def test_six_positions_return_bias_scale_and_response() -> None:
    g = 1.0017
    out = FACES * g @ K.T + BIAS
    calibration = ferraris(out[:3], out[3:], g)
    np.testing.assert_allclose(calibration.bias, BIAS, atol=1e-12)
    np.testing.assert_allclose(calibration.response, K, atol=1e-12)
    up = np.stack([np.eye(3) @ K.T + BIAS, 2.0 * np.eye(3) @ K.T - BIAS])  # a batch
    down = np.stack([-np.eye(3) @ K.T + BIAS, -2.0 * np.eye(3) @ K.T - BIAS])
    np.testing.assert_allclose(ferraris(up, down, 1.0).bias, [BIAS, -BIAS], atol=1e-12)
    np.testing.assert_allclose(ferraris(up, down, 1.0).response, [K, 2.0 * K], atol=1e-12)


def test_ferraris_and_least_squares_agree_on_perfect_faces() -> None:
    out = FACES * 9.81 @ K.T + BIAS
    published, better = ferraris(out[:3], out[3:], 9.81), faces(out[:3], out[3:], 9.81)
    np.testing.assert_allclose(published.scale @ published.rotation, K, atol=1e-12)
    np.testing.assert_allclose(better.response, K, atol=1e-12)
    np.testing.assert_allclose(better.bias, published.bias, atol=1e-12)
    assert np.all(better.rms < 1e-10)
    bent = FACES @ K.T + BIAS + 0.5 * FACES**2  # a second-order term shows as lack of fit
    assert np.all(faces(bent[:3], bent[3:], 1.0, np.full(3, 0.01)).p_value < 1e-6)


def test_the_axis_polynomial_returns_its_coefficients(rng: np.random.Generator) -> None:
    out, heat = rng.uniform(-2.0, 2.0, (4, 30, 3)), rng.uniform(0.0, 50.0, (4, 30))
    c = np.array([0.1, 0.9, -0.02, 0.003])
    force = sum(c[k] * out**k for k in range(4)) + 1e-3 * (heat - 25.0)[..., None]
    fit = fit_axis_polynomial(out, force, temperature=heat)
    np.testing.assert_allclose(fit.coefficients, np.broadcast_to([*c, 1e-3], (4, 3, 5)), atol=1e-10)
    np.testing.assert_allclose(fit.apply(out, heat), force, atol=1e-10)
    levels = np.tile(np.array([[-1.0], [0.0], [1.0]]), (4, 3))
    with pytest.raises(NotIdentified, match="do not determine degree 3"):
        fit_axis_polynomial(levels, levels)


def test_a_cubic_that_is_true_is_adequate_and_a_rate_term_is_not(rng: np.random.Generator) -> None:
    heat = np.linspace(-20.0, 60.0, 2000)
    truth = 9.8 + 1e-3 * heat - 2e-6 * heat**2 + 3e-7 * heat**3
    fit = fit_temperature_curve(truth[:, None] + 0.003 * rng.normal(size=(2000, 3)), heat)
    assert fit.adequate
    powers = (heat[:, None] - fit.reference_temperature) ** np.arange(4)
    np.testing.assert_allclose(powers @ fit.coefficients[0], truth, atol=5e-4)
    heat = 20.0 + 40.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 2000))
    output = 1e-3 * heat[:, None] + 0.1 * np.gradient(heat)[:, None] + 0.003 * rng.normal(size=(2000, 3))
    assert not fit_temperature_curve(output, heat).adequate


def test_a_sphere_fit_refuses_what_cannot_be_determined(rng: np.random.Generator) -> None:
    output, heat = directions(rng, 24), np.full(24, 20.0)
    flat = directions(rng, 24) * [1.0, 1.0, 0.0]
    output[7, 1], heat[3] = np.nan, np.inf
    for words, refused, temperature in (
        ("dwell 7 is not finite", output, None),
        ("dwell 3 is not finite", directions(rng, 24), heat),
        (r"output z never changes|undetermined", flat @ K.T + BIAS, None),
        ("9 dwells, more than 9", directions(rng, 9), None),
    ):
        with pytest.raises(NotIdentified, match=words):
            fit_ellipsoid(refused, temperature=temperature)


def directions(rng: np.random.Generator, *shape: int) -> np.ndarray:
    f = rng.normal(size=(*shape, 3))
    return f / np.linalg.norm(f, axis=-1, keepdims=True)


def test_the_sphere_fit_returns_a_batch_of_units_without_noise(rng: np.random.Generator) -> None:
    f = directions(rng, 5, 24)
    scale = 1.0 + 0.01 * np.arange(5)[:, None, None]
    fit = fit_ellipsoid(f @ K.T * scale + BIAS, norm=1.0)
    np.testing.assert_allclose(fit.response, K * scale, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(fit.bias, np.broadcast_to(BIAS, (5, 3)), rtol=1e-7)
    assert np.all(fit.rms < 1e-9)
    f, heat, offset = directions(rng, 60), rng.uniform(-20.0, 60.0, 60), np.array([0.02, -0.05, 0.01])
    fit = fit_ellipsoid(f @ K.T + BIAS + (heat - heat.mean())[:, None] * offset, temperature=heat)
    np.testing.assert_allclose(fit.temperature_offset, offset, rtol=1e-6)


def test_the_sphere_fit_does_not_care_how_the_fixture_is_turned(rng: np.random.Generator) -> None:
    f = directions(rng, 30)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    noise = 0.01 * rng.normal(size=(30, 3))
    one, other = fit_ellipsoid(f @ K.T + BIAS + noise), fit_ellipsoid(-(f @ K.T + BIAS + noise) @ turn.T)
    assert float(one.rms) == pytest.approx(float(other.rms), rel=1e-6)
