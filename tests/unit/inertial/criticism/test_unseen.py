"""What the temperatures of a run cannot show."""

import numpy as np
import pytest
from made_worlds import BASE, World, make

from inertial import effects as catalogue
from inertial.criticism.field import Candidates
from inertial.criticism.unseen import unseen
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from pipelines.tables.dwells import lot_of, measured

SEED = 5_500_000


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
