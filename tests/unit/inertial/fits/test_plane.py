"""A sensor turned about one of its axes: the two axes in the plane are calibrated, and what stays open is said."""

from contextlib import suppress

import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow

from inertial.errors import NotIdentified
from inertial.fits import plane
from inertial.fits.plane import fit_plane, fit_plane_norm, plane_across, quiet_axis
from pipelines.diagnosis.diagnose import diagnose
from pipelines.importers.plane import GROSS, axis_of_plane
from schemas.errors import DataRejected

RESPONSE = np.array([[1.01, 0.002, -0.003], [0.004, 0.99, 0.001], [0.002, -0.005, 1.005]])
BIAS = np.array([0.01, 0.02, -0.03])
NOISE = 20e-6


def turned(rng: np.random.Generator, count: int = 24, cubic: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Force and output of a sensor turned about its y axis in equal steps."""
    angle = rng.uniform(0.0, 6.28) + 2.0 * np.pi * np.arange(count) / count
    force = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    output = BIAS + force @ RESPONSE.T + NOISE * rng.standard_normal((count, 3))
    output[:, 0] += cubic * force[:, 0] ** 3
    return force, output


def upper(response: np.ndarray) -> np.ndarray:
    return np.linalg.inv(np.linalg.cholesky(np.linalg.inv(response @ response.T)).T)


def test_the_axis_across_the_plane_is_found_and_general_orientations_have_none(rng: np.random.Generator) -> None:
    force, output = turned(rng)
    assert plane_across(force) == 1
    assert quiet_axis(output) == 1
    assert plane_across(rng.standard_normal((24, 3))) is None
    tilted = force @ np.linalg.qr(rng.standard_normal((3, 3)))[0]
    assert plane_across(tilted) is None
    with pytest.raises(NotIdentified, match="more than 3 are needed"):
        fit_plane(np.ones((3, 3)), np.eye(3), 1, np.arange(3.0), np.ones((3, 3)))


@pytest.mark.parametrize("known", mostly_slow([True, False], False))
def test_stated_intervals_hold_the_truth(rng: np.random.Generator, *, known: bool) -> None:
    """Standard errors of facts D for 24 equal steps: σ/√n of the bias, σ√(2/n) of the response; 15 records."""
    flat = upper(RESPONSE[np.ix_([0, 2], [0, 2])])
    hits, total, errors = 0, 0, []
    for _ in range(15):
        force, output = turned(rng)
        time, error = 30.0 * np.arange(24), np.full((24, 3), NOISE)
        if known:
            fit = fit_plane(output, force, 1, time, error)
            truth = RESPONSE[:, [0, 2]]
        else:
            fit = fit_plane_norm(output, 1, 1.0, time, error)
            truth = np.array([flat[0], fit.response[1], flat[1]])
        inside = np.abs(np.column_stack([fit.bias - BIAS, fit.response - truth]))
        stated = 2.0 * np.column_stack([fit.bias_error, fit.response_error])
        hits, total = hits + int(np.sum(inside <= stated + 1e-15)), total + inside.size
        errors.append(fit.response_error[0, 0])
    assert hits / total > 0.91  # 0.68 with errors half as large
    assert np.median(errors) == pytest.approx(NOISE * np.sqrt(2.0 / 24.0), rel=0.35) or not known


def test_a_third_order_term_is_seen_in_the_harmonics_of_the_angle(rng: np.random.Generator) -> None:
    time, error = 30.0 * np.arange(24), np.full((24, 3), NOISE)
    force, output = turned(rng, cubic=1e-3)
    assert fit_plane(output, force, 1, time, error).p_value < 1e-6
    assert fit_plane_norm(output, 1, 1.0, time, error).p_value < 0.01
    force, output = turned(rng)
    assert fit_plane(output, force, 1, time, error).p_value > 0.01


@pytest.mark.parametrize("count", [9, 12])
def test_a_dead_axis_is_never_a_turn(rng: np.random.Generator, count: int) -> None:
    """General orientations with y at rest: a bias without bound made all forces alike, and the residual 0.0 µg."""
    for _ in range(6):
        force = rng.standard_normal((count, 3))
        output = BIAS + force / np.linalg.norm(force, axis=1, keepdims=True) @ RESPONSE.T
        output[:, 1] = 0.001
        output += NOISE * rng.standard_normal((count, 3))
        if quiet_axis(output) != 1:
            continue
        with suppress(NotIdentified):
            fit = fit_plane_norm(output, 1, 1.0, 30.0 * np.arange(count), np.full((count, 3), NOISE))
            assert fit.misfit > GROSS


def test_an_arc_is_a_turn_and_gives_its_coefficients(rng: np.random.Generator) -> None:
    angle = np.radians(np.arange(-60.0, 61.0, 10.0))
    force = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    output = BIAS + force @ RESPONSE.T + NOISE * rng.standard_normal(force.shape)
    fit = fit_plane_norm(output, 1, 1.0, 30.0 * np.arange(13), np.full((13, 3), NOISE))
    assert fit.misfit < 4.0 * NOISE
    assert fit.bias[[0, 2]] == pytest.approx(BIAS[[0, 2]], abs=2e-3)


def test_the_norm_alone_gives_no_scale_to_an_axis_that_was_not_turned(rng: np.random.Generator) -> None:
    """It did: a scale of 0.003 g per m/s², and "adequate"."""
    output = turned(rng)[1]
    frame = pd.DataFrame(output, columns=["out_x", "out_y", "out_z"])
    dwells = frame.assign(unit="P", dwell=range(24), time_s=30.0 * np.arange(24), out_unit="g", kind="dwell")
    assert axis_of_plane(dwells) == 1
    with pytest.raises(DataRejected, match="does not show its scale; turn all axes, or fit the two others"):
        diagnose(dwells)


@pytest.mark.parametrize("unknown", [0, 1, 2])
def test_a_probability_that_is_no_number_stays_none(rng, monkeypatch, unknown):
    p_values = [np.nan if k == unknown else 0.8 for k in range(3)]
    monkeypatch.setattr(plane, "_harmonics", lambda *_: p_values.pop(0))
    force, output = turned(rng)
    fit = fit_plane(output, force, 1, 30.0 * np.arange(24), np.full((24, 3), NOISE))
    assert np.isnan(fit.p_value)
