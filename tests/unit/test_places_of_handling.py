"""The dwell of a handling error is chosen again with all other terms in the model."""

import sys
from pathlib import Path

import pytest

from inertial import effects as catalogue
from inertial.data_errors.handling import named
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import better_placed, terms_of
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from world import World, make

BASE = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]


@pytest.mark.parametrize("beside", [-2, 0, 3])
def test_a_unit_that_moved_is_placed_at_the_dwell_of_the_move(beside: int) -> None:
    made = make(World(units=3, fault="unit_moved", amount=1.0), 6_600_001)
    (told,) = made.faults
    problem = Problem(lot_of(measured(made.dwells, made.history)))
    moved = named("unit_moved")
    assert moved is not None

    def at(dwell: int) -> Term:
        return Term(moved, (("unit", float(int(told.units[0][1:]) - 1)), ("dwell", float(dwell))))

    model = Model(problem, [*terms_of(catalogue.get_all(BASE), problem), at(told.dwells[0] + beside)])
    assert better_placed(model, model.terms[-1]) == (at(told.dwells[0]) if beside else None)


def test_an_error_without_an_instant_stays_where_it_is() -> None:
    made = make(World(units=3), 6_600_002)
    problem = Problem(lot_of(measured(made.dwells, made.history)))
    pose = named("pose_off")
    assert pose is not None
    term = Term(pose, (("pose", 3.0),))
    model = Model(problem, [*terms_of(catalogue.get_all(BASE), problem), term])
    assert better_placed(model, term) is None
