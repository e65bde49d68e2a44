"""Parts of a diagnosis on worlds whose generator shares nothing with the estimator."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial import effects as catalogue
from inertial.criticism.field import Candidates
from inertial.criticism.unseen import unseen
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation.likelihood import scatter_of_poses
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Gain
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from noise import Noise
from world import World, make

BASE = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
SEED = 5_500_000


@pytest.mark.parametrize(("rest", "least", "most"), [(0.0, 1.0, 1.0), (20.0, 2.0, 8.0)])
def test_what_is_said_of_the_station_stands_out_of_the_scatter_of_all_poses(rest, least, most):
    made = make(World(soaks=(25.0,), repeats=2, rest=rest), SEED)
    problem = Problem(lot_of(measured(made.dwells, made.history)))
    model = Model(problem, terms_of(catalogue.get_all(BASE[:3]), problem))
    # 20 µrad of rest beside 10 µg of the mean of eight units: about 1 + (20/10)² in variance
    assert least <= scatter_of_poses(model) <= most


@pytest.mark.parametrize("history", [True, False])
def test_the_scatter_of_a_thermometer_shows_no_narrow_hysteresis(history):
    made, rng = make(World(units=1, poses=12), SEED), np.random.default_rng(3)
    tables = [made.dwells.copy(), made.history.copy()]
    for table in tables:
        table["unit_C"] += 0.1 * rng.standard_normal(len(table))
    problem = Problem(lot_of(measured(tables[0], tables[1] if history else None)))
    base = Model(problem, terms_of(catalogue.get_all(BASE), problem))
    effect = catalogue.get("thermal_hysteresis")
    (_, ranges), *_ = unseen(Candidates(problem, [effect]), base, [effect])[1]
    # soaks that only climb by 35 K hide a play that is narrower
    assert ranges[0].low == 1.0
    assert 15.0 < ranges[0].high < 35.0


def test_a_column_of_one_dwell_gains_the_same_without_being_whitened():
    made = make(World(units=3, durations=(2.0, 60.0), noise=Noise(unit_white=(5.0, 1.0, 1.0))), SEED)
    dwells = made.dwells.drop(
        index=made.dwells.index[(made.dwells["unit"] == "W002") & made.dwells["dwell"].isin([5, 6])]
    )
    problem = Problem(lot_of(measured(dwells, made.history)))
    model = Model(problem, terms_of(catalogue.get_all([*BASE, "level_error"]), problem))
    field = Candidates(problem, [], [WrongPose()])
    quick = field.gains(model.space, set(), handling=True)["wrong_pose"]
    pieces = problem.pieces(WrongPose(), field.grids["wrong_pose"])
    plain = Gain.joined([model.space.gain(piece) for piece in pieces])
    np.testing.assert_array_equal(quick.rank, plain.rank)
    np.testing.assert_allclose(quick.drop, plain.drop, rtol=1e-6, atol=1e-6)
