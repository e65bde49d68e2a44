"""Rivals that no measurement of a station parts are said to be so; others get a measurement that parts them when it is made."""

from dataclasses import replace

import made_worlds as _  # noqa: F401
import numpy as np

from inertial import effects
from inertial.criticism.classes import EffectClass, Member
from inertial.design import grid_of
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.term import Term
from inertial.next_measurement.proposals import Proposal, proposal, rivals_in, twins
from inertial.next_measurement.separation import apart, predictions, residual_squares, widened
from inertial.planning.sequences import SequenceStep
from pipelines.diagnosis.next_measurement import Proposed, rows_of
from pipelines.tables.dwells import lot_of, measured

# found by way of the worlds
import part  # isort: skip


def problem_of(blind, seed: int):
    return Problem(lot_of(measured(*part.Continued(blind, seed).tables())))


def rivals(problem, *names: str) -> tuple[Model, EffectClass]:
    base = [Term(effects.get(name)) for name in ("bias", "scale", "misalignment")]
    terms = [Term(e, tuple(grid_of(e, problem.lot.state)[0].items())) for e in map(effects.get, names)]
    members = tuple(Member(t, 0.5 * k) for k, t in enumerate(terms))
    return Model(problem, [*base, terms[0]]), EffectClass(members, -30.0, 1e-5)


def test_level_and_the_offset_of_the_outer_encoder_get_a_sentence_and_no_steps() -> None:
    problem = problem_of(part.Blind("level_error", 4.0, "corners", 1, units=3), 5)
    model, group = rivals(problem, "outer_encoder_offset", "level_error")
    alike = twins(model, group)
    assert alike == ("outer_encoder_offset", "level_error")
    assert proposal(model, group) is None
    rows = Proposed(((group, None),), None, (alike,)).rows()
    assert [row["measurable"] for row in rows] == [False]
    assert "no measurement of this station separates them; needed: a level on the table" in rows[0]["why"]


def test_rivals_that_poses_part_are_no_twins() -> None:
    problem = problem_of(part.Blind("third_order", 4.0, "edges", 2, units=3), 5)
    model, group = rivals(problem, "third_order", "odd_quadratic")
    assert twins(model, group) == ()
    assert proposal(model, group) is not None


def test_a_kink_that_may_move_is_not_promised_as_far_away_as_one_that_may_not() -> None:
    blind = part.Blind("bias_temperature_quadratic", 4.0, "faces", 1, (0.0, 20.0, 40.0, 60.0), units=3)
    problem = problem_of(blind, 8)
    model, group = rivals(problem, "bias_temperature_quadratic", "thermal_kink")
    pair = rivals_in(model, group)
    steps = [SequenceStep(o, 0.0, t, 2.0) for t in (30.0, 10.0) for o in (0.0, np.pi)]
    free = apart(pair, steps).left[0, 1]
    wide = widened(pair, steps, None)
    noise = wide.covariance.rescaled(pair.noise, pair.covariance)
    fixed = residual_squares(Model(wide, [*pair.rest, group.members[1].term]), predictions(pair, wide), noise)[0]
    assert free < 0.5 * fixed * pair.weight / pair.variance


STEP = SequenceStep(0.1, 0.2, 25.0)


def test_equal_steps_in_a_row_are_one_with_their_number_and_one_after_the_devices_were_off_stands_apart() -> None:
    pair = ("warm_up", "aging_log")
    made = Proposal(1.0, 30.0, pair, kinds=("poses",), steps=(), pair=pair, minutes=12.0, settled=1.0)
    for steps, told in (
        ((STEP, STEP, replace(STEP, inner=0.3), STEP), [(2, None), (1, None), (1, None)]),
        ((STEP, STEP, replace(STEP, off=600.0), STEP, STEP), [(2, None), (1, 600.0), (2, None)]),
    ):
        assert [(row["repeats"], row.get("off_s")) for row in rows_of(replace(made, steps=steps))] == told
