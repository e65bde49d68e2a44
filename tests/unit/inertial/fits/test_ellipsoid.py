"""The sphere fit returns what went in, and refuses what cannot be determined."""

import numpy as np
import pytest

from inertial.errors import NotIdentified
from inertial.fits.ellipsoid import fit_ellipsoid


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


K = np.array([[101.0, 0.4, -0.7], [0.0, 99.0, 0.3], [0.0, 0.0, 102.5]])
BIAS = np.array([3.0, -12.0, 0.5])


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
