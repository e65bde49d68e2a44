"""Dwells that began before the table stood: samples of the pose before, or of the way to the pose, in the mean of a dwell."""

from dataclasses import replace

import numpy as np
import pytest
from made_worlds import BASE, World, lot_in, make

from inertial.criticism.diagnosis import diagnose
from inertial.frames import force_from_angles

DWELLS = (9, 28)


@pytest.mark.parametrize(("share_of", "name"), [("the pose before", "dwell_too_early"), ("the way", "wrong_pose")])
def test_dwells_that_began_too_early_are_told_and_nothing_else(share_of: str, name: str) -> None:
    """They were told as jumps of single axes: a mean that is shorter than gravity is no tilt."""
    lot = lot_in(make(World(units=4, poses=18, soaks=(25.0, 60.0)), 31))
    output = np.array(lot.output)
    for k in DWELLS:
        if share_of == "the pose before":
            output[:, k] += 5e-4 * (output[:, k - 1] - output[:, k])
            continue
        (a, b), (c, d) = (
            np.unwrap(angle.reshape(-1, angle.shape[-1])[0, k - 1 : k + 1])
            for angle in (lot.state.outer, lot.state.inner)
        )
        part = np.linspace(0.7, 1.0, 100)  # the table turns at a constant rate, both axes at once
        way = force_from_angles(a + part * (b - a), c + part * (d - c)).mean(axis=0) - force_from_angles(b, d)
        output[:, k] += 6e-4 * way / np.linalg.norm(way)
    found = diagnose(replace(lot, output=output), BASE, np.random.default_rng(2))
    assert sorted(d for named in found.handled for d in named.dwells) == sorted(DWELLS)
    assert {named.effects.ids[0] for named in found.handled} == {name}
    assert (found.named, found.removed, found.unexplained) == ((), (), None)
