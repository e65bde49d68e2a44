"""What a plan sees: values of parameters that it hides, and the errors of coefficients that it lets expect."""

import numpy as np
import pytest
from posed import posed

from inertial import poses
from inertial.errors import NotIdentified
from inertial.fits.linear import fit_lot
from inertial.planning.expected import expected_errors
from inertial.planning.visibility import visibilities
from inertial.state import History, State

MODEL = ("bias", "scale", "misalignment", "bias_temperature")


def soaked(soaks: tuple[float, ...]) -> State:
    """Six faces at every soak, an hour each, with the temperature between them."""
    time = 3600.0 * np.repeat(np.arange(len(soaks)), 6) + 2000.0 + 30.0 * np.tile(np.arange(6), len(soaks))
    grid = np.arange(0.0, 3600.0 * len(soaks), 60.0)
    hour = 3600.0 * np.arange(len(soaks))
    reached = np.interp(grid, np.ravel(np.stack([hour + 1500.0, hour + 2400.0], axis=1)), np.repeat(soaks, 2))
    six = np.tile(poses.plan("six"), (len(soaks), 1))
    return posed(six, time=time, temperature=np.repeat(np.array(soaks), 6), history=History(grid, reached))


def test_climbing_soaks_hide_a_narrow_hysteresis_and_a_closed_loop_what_is_wider_than_itself() -> None:
    climb, loop = (0.0, 20.0, 40.0, 60.0), (0.0, 20.0, 40.0, 60.0, 40.0, 20.0, 0.0)
    visibility, closed = (visibilities(soaked(one), MODEL, 1e-6, ["thermal_hysteresis"])[0] for one in (climb, loop))
    assert visibility.seen  # a wide one is dragged along only after the first steps
    narrow = visibility.unseen_ranges[0]
    assert (narrow.parameter, narrow.unit) == ("half_width", "K")
    # by hand: narrower than half a step, the play is taken up before the second soak whatever its state was at the first
    assert narrow.low == 1.0
    grid = np.geomspace(1.0, 60.0, 10)
    assert narrow.high == grid[grid < 10.0].max()
    assert closed.seen
    assert all(r.low > 29.0 for r in closed.unseen_ranges)
    per_effect = visibilities(soaked((0.0, 40.0)), MODEL, 1e-6, ["second_order", "scale_temperature"])
    assert [v.unseen_ranges for v in per_effect] == [(), ()]  # effects without parameters


def test_a_base_of_the_station_alone_hides_no_effect_of_the_sensor() -> None:
    (bias,) = visibilities(soaked((0.0, 40.0)), ["level_error"], 1e-6, ["bias"])
    assert bias.remaining_fraction == pytest.approx(1.0)


THERMAL = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")


def course(soaks=(25.0, 60.0, -10.0, 25.0), per_soak=18):
    angles = np.tile(poses.plan("fibonacci24")[:per_soak], (len(soaks), 1))
    time = np.arange(len(angles)) * 14.0 + 1500.0 * (1 + np.arange(len(angles)) // per_soak)
    return posed(angles, time=time, temperature=np.repeat(soaks, per_soak))


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
