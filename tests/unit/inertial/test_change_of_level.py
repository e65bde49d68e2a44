"""A motion that is cut into pieces holds no positions; positions of some samples each are told."""

import numpy as np

from inertial.change_of_level import several_levels


def test_pieces_near_the_shortest_are_a_motion_and_longer_ones_are_positions(rng: np.random.Generator) -> None:
    steps = rng.normal(size=(40, 3))
    for samples, positions in ((6, 1), (25, 40)):
        record = np.repeat(steps, samples, axis=0) + 0.001 * rng.normal(size=(40 * samples, 3))
        assert several_levels(record) == positions
