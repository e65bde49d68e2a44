"""Errors of coefficients as a plan lets expect them, against the spread of fits to the plant's own noise."""

import numpy as np
import pytest
from posed import posed

from inertial import poses
from inertial.errors import NotIdentified
from inertial.fits.linear import fit_lot
from inertial.fits.wander import fit_lot_with_wander
from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.planning.expected import expected_errors
from stations.plant.noise import UnitNoise
from stations.plant.preset import load_preset

THERMAL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
UNITS, DWELL_S, RATE = 100, 5.0, 10.0


def course(soaks=(25.0, 60.0, -10.0, 25.0), per_soak=18):
    angles = np.tile(poses.plan("fibonacci24")[:per_soak], (len(soaks), 1))
    time = np.arange(len(angles)) * 14.0 + 1500.0 * (1 + np.arange(len(angles)) // per_soak)
    return posed(angles, time=time, temperature=np.repeat(soaks, per_soak))


def drawn(preset, state):
    """Dwell means of units whose output is the force and the plant's noise, (units, n, 3) in g, and their white error."""
    noise = UnitNoise(preset, [np.random.default_rng([11, k]) for k in range(UNITS)])
    before, means = 0.0, []
    for start in state.time - DWELL_S / 2.0:
        noise.jump(start - before)
        means.append(noise.sample(round(DWELL_S * RATE), RATE).mean(axis=0))
        before = start + DWELL_S
    return state.force + np.stack(means, axis=1)


@pytest.mark.parametrize("name", ["SF1500", "ADXL355", "analogue"])
def test_errors_of_a_lots_fits_are_those_that_the_plan_let_expect(name):
    preset, state = load_preset(name), course()
    noise = DwellNoise(
        1e-6 * preset.sampled_density_ug(RATE), 1e-6 * preset.bias_instability_ug, 1e-6 * preset.rate_random_walk_ug
    )
    output = drawn(preset, state)
    error = np.full(output.shape, noise.white(DWELL_S))
    fit = fit_lot_with_wander(THERMAL, state, output, error).fit
    truth = np.array([1.0 if effect == "scale" else 0.0 for effect, _ in fit.names[0]])
    really = np.sqrt(np.mean((fit.coefficients - truth) ** 2, axis=0))
    expected = expected_errors(THERMAL, state, dwell_covariance(state.time, DWELL_S, noise)).errors
    ratio = really / expected
    assert ratio[:, 1:].mean() == pytest.approx(1.0, abs=0.07)
    assert np.all((ratio[:, 1:] > 0.75) & (ratio[:, 1:] < 1.3))
    # the bias carries flicker slower than the run besides, which a run cannot know
    assert ratio[:, 0].mean() == pytest.approx(1.0, abs=0.2)


def test_white_noise_alone_gives_the_errors_of_the_weighted_fit():
    state, error = course(), 1e-5
    plain = fit_lot(THERMAL, state, state.force.copy(), np.full(state.force.shape, error))
    expected = expected_errors(THERMAL, state, error**2 * np.eye(state.time.size))
    assert expected.errors == pytest.approx(plain.standard_errors, rel=1e-6)
    state = course(soaks=(25.0,))  # it does not determine the temperature coefficients
    with pytest.raises(NotIdentified, match="bias_temperature"):
        expected_errors(THERMAL, state, np.eye(state.time.size))


def test_parameters_of_the_station_gain_with_every_unit():
    state = posed(poses.plan("twenty_six"))
    model = ("bias", "scale", "misalignment", "level_error")
    one, nine = (expected_errors(model, state, 1e-10 * np.eye(26), units=units) for units in (1, 9))
    assert one.shared_errors == pytest.approx(3.0 * nine.shared_errors)
    plain = fit_lot(model, state, np.tile(state.force, (9, 1, 1)), np.full((9, 26, 3), 1e-5))
    assert nine.shared_errors == pytest.approx(np.sqrt(np.diagonal(plain.shared_covariance)), rel=1e-6)
