"""Rows of the proposals in a diagnosis: what is measured, step by step, as documents hold it."""

from dataclasses import replace

from inertial.next_measurement.proposals import Proposal
from inertial.planning.sequences import SequenceStep
from pipelines.diagnosis.next_measurement import rows_of

STEP = SequenceStep(0.1, 0.2, 25.0)


def proposed(*steps: SequenceStep) -> Proposal:
    return Proposal(("poses",), steps, ("warm_up", "aging_log"), ("warm_up", "aging_log"), 12.0, 1.0, 30.0, 1.0)


def test_equal_steps_in_a_row_are_one_with_their_number() -> None:
    rows = rows_of(proposed(STEP, STEP, replace(STEP, inner=0.3), STEP))
    assert [row["repeats"] for row in rows] == [2, 1, 1]


def test_a_step_after_the_devices_were_off_stands_apart_from_those_beside_it() -> None:
    rows = rows_of(proposed(STEP, STEP, replace(STEP, off=600.0), STEP, STEP))
    assert [row["repeats"] for row in rows] == [2, 1, 2]
    assert [row.get("off_s") for row in rows] == [None, 600.0, None]
