"""Why an inquiry ends without a follow-up."""

from types import SimpleNamespace
from typing import Literal

import numpy as np

from inertial.data_errors.handling.not_soaked import NotSoaked
from pipelines.inquiry.inquiry import NO_FOLLOW_UP, ending_of, no_follow_up


def joint(
    adequate: Literal[True, False] | None, *classes: list[str], twins: tuple[tuple[str, ...], ...] = ()
) -> SimpleNamespace:
    document = {
        "adequate": adequate,
        "reason": "6 degrees of freedom, 15 are needed" if adequate is None else None,
        "classes": [{"effects": group} for group in classes],
        "recommended": [group[0] for group in classes],
    }
    ambiguous = [group for group in classes if len(group) > 1]
    return SimpleNamespace(
        document=document, diagnosis=object(), ambiguous=ambiguous, following=SimpleNamespace(twins=twins)
    )


def test_an_inquiry_ends_by_what_was_judged_and_not_where_a_class_is_open() -> None:
    ending = ending_of(joint(None))
    assert ending.text == "the model cannot be judged: 6 degrees of freedom, 15 are needed"
    assert ending.end in NO_FOLLOW_UP
    assert ending.end == "not_judged"
    assert ending_of(joint(False)).end == "unexplained"
    assert ending_of(joint(False, ["third_order"])).end == "told_apart"
    assert ending_of(joint(False, ["third_order", "clipping"])) is None


def test_what_no_dwells_left_out_judge_is_named_and_said_to_be_unconfirmed() -> None:
    one = joint(False, ["cross_coupling"])
    one.document["classes"][0] |= {"scope": "sensor", "heldout_after_ug": None}
    one.document["recommended"] = []
    ending = ending_of(one)
    assert ending.text.endswith("no dwells left out can judge cross_coupling: confirm with a fresh run")


def test_a_class_that_no_follow_up_parts_for_sure_is_not_called_impossible_to_part() -> None:
    group = ["third_order", "clipping"]
    assert "no follow-up was found" in no_follow_up(joint(False, group))
    assert no_follow_up(joint(False, group, twins=(("third_order", "clipping"),))).startswith("no measurement on this")


def test_a_device_that_had_not_soaked_follows_by_about_its_own_coefficients() -> None:
    sizes = {1.15: True, 0.7: True, 0.022: False, -1.0: False, 8.0: False}
    assert {size: NotSoaked().possible(np.array([size])) for size in sizes} == sizes
