"""Values of an effect's parameters at which a plan cannot see it are listed, though it sees the effect at others."""

import numpy as np
from posed import posed

from inertial import poses
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


def hysteresis(soaks: tuple[float, ...]):
    return visibilities(soaked(soaks), MODEL, 1e-6, ["thermal_hysteresis"])[0]


def test_soaks_that_only_climb_hide_a_hysteresis_narrower_than_half_their_step() -> None:
    visibility = hysteresis((0.0, 20.0, 40.0, 60.0))
    assert visibility.seen  # a wide one is dragged along only after the first steps
    narrow = visibility.unseen_ranges[0]
    assert (narrow.parameter, narrow.unit) == ("half_width", "K")
    # by hand: narrower than half a step, the play is taken up before the second soak whatever its state was at the first
    assert narrow.low == 1.0
    grid = np.geomspace(1.0, 60.0, 10)
    assert narrow.high == grid[grid < 10.0].max()


def test_a_closed_loop_hides_only_what_is_wider_than_itself() -> None:
    visibility = hysteresis((0.0, 20.0, 40.0, 60.0, 40.0, 20.0, 0.0))
    assert visibility.seen
    assert all(r.low > 29.0 for r in visibility.unseen_ranges)
    per_effect = visibilities(soaked((0.0, 40.0)), MODEL, 1e-6, ["second_order", "scale_temperature"])
    assert [v.unseen_ranges for v in per_effect] == [(), ()]  # effects without parameters
