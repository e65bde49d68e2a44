"""What places of alternatives explain, without being whitened."""

import numpy as np
from made_worlds import BASE, Noise, World, make

from inertial import effects as catalogue
from inertial.criticism.field import Candidates
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Gain
from pipelines.tables.dwells import lot_of, measured


def test_a_column_of_one_dwell_gains_the_same_without_being_whitened():
    made = make(World(units=3, durations=(2.0, 60.0), noise=Noise(unit_white=(5.0, 1.0, 1.0))), 5_500_000)
    there = (made.dwells["unit"] != "W002") | ~made.dwells["dwell"].isin([5, 6])
    problem = Problem(lot_of(measured(made.dwells[there], made.history)))
    model = Model(problem, terms_of(catalogue.get_all([*BASE, "level_error"]), problem))
    field = Candidates(problem, [], [WrongPose()])
    quick = field.gains(model.space, set(), handling=True)["wrong_pose"]
    pieces = problem.pieces(WrongPose(), field.grids["wrong_pose"])
    plain = Gain.joined([model.space.gain(piece) for piece in pieces])
    np.testing.assert_array_equal(quick.rank, plain.rank)
    np.testing.assert_allclose(quick.drop, plain.drop, rtol=1e-6, atol=1e-6)
