"""The scatter of all poses, as the likelihood has it."""

import pytest
from made_worlds import BASE, World, make, problem_in

from inertial import effects as catalogue
from inertial.estimation.likelihood import scatter_of_poses
from inertial.estimation.model import Model
from inertial.estimation.refinement import terms_of

SEED = 5_500_000


@pytest.mark.parametrize(("rest", "least", "most"), [(0.0, 1.0, 1.0), (20.0, 2.0, 8.0)])
def test_what_is_said_of_the_station_stands_out_of_the_scatter_of_all_poses(rest, least, most):
    made = make(World(soaks=(25.0,), repeats=2, rest=rest), SEED)
    problem = problem_in(made)
    model = Model(problem, terms_of(catalogue.get_all(BASE[:3]), problem))
    # 20 µrad of rest beside 10 µg of the mean of eight units: about 1 + (20/10)² in variance
    assert least <= scatter_of_poses(model) <= most
