"""The dwell of a handling error or a step is chosen again with all other terms in the model."""

from dataclasses import replace

import numpy as np
import pytest
from made_worlds import BASE, Noise, World, make, problem_in

from inertial import effects as catalogue
from inertial.data_errors.handling import named
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import better_placed, terms_of
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured


@pytest.mark.parametrize("beside", [-2, 0, 3])
def test_a_unit_that_moved_is_placed_at_the_dwell_of_the_move(beside: int) -> None:
    made = make(World(units=3, fault="unit_moved", amount=1.0), 6_600_001)
    (told,) = made.faults
    problem = problem_in(made)
    moved = named("unit_moved")
    assert moved is not None

    def at(dwell: int) -> Term:
        return Term(moved, (("unit", float(int(told.units[0][1:]) - 1)), ("dwell", float(dwell))))

    model = Model(problem, [*terms_of(catalogue.get_all(BASE), problem), at(told.dwells[0] + beside)])
    assert better_placed(model, model.terms[-1]) == (at(told.dwells[0]) if beside else None)


def test_an_error_without_an_instant_stays_where_it_is() -> None:
    made = make(World(units=3), 6_600_002)
    problem = problem_in(made)
    pose = named("pose_off")
    assert pose is not None
    term = Term(pose, (("pose", 3.0),))
    model = Model(problem, [*terms_of(catalogue.get_all(BASE), problem), term])
    assert better_placed(model, term) is None


@pytest.mark.parametrize("later_s", [0.0, 12.0])
def test_a_step_is_placed_in_each_gap_of_a_run_longer_than_the_grid(later_s: float) -> None:
    # units read one after the other divide each gap, and the grid has one instant in five
    units, dwells = 4, 3 * 48
    made = make(World(units=units, poses=48, noise=Noise(white=25.0, flicker=30.0)), 5_900_001)
    lot = lot_of(measured(made.dwells, made.history), square=False)
    state = replace(lot.state, time=lot.state.time + later_s * np.arange(units)[:, None] / units, memory={})
    effects = catalogue.get_all([*BASE, "step_change"])
    (instant,) = effects[-1].parameters(state)
    assert len(instant.choices) < dwells - 3
    for dwell in range(40, 110, 9):
        later = (np.arange(dwells) >= dwell)[None, :, None]
        jumped = replace(lot, state=replace(state, memory={}), output=lot.output + 300e-6 * later)
        found = terms_of(effects, Problem(jumped))[-1].keywords["instant"]
        assert ((state.time > found).argmax(axis=1) == dwell).all()
