"""Why an inquiry ends without a follow-up."""

from types import SimpleNamespace
from typing import Literal

import numpy as np
import pytest

from inertial.data_errors.handling.not_soaked import NotSoaked
from pipelines.inquiry.endings import NO_FOLLOW_UP, ending_of, no_follow_up
from pipelines.jobs.recipes import _resolve
from schemas.errors import RecipeInvalid


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


def test_a_model_that_cannot_be_judged_ends_with_the_reason_and_is_not_called_inadequate() -> None:
    ending = ending_of(joint(None))
    assert ending is not None
    assert ending.end == "not_judged"
    assert ending.text == "the model cannot be judged: 6 degrees of freedom, 15 are needed"
    assert ending.end in NO_FOLLOW_UP


def test_a_model_that_is_not_adequate_ends_otherwise() -> None:
    unexplained, alone, open_ = (
        ending_of(joint(False)), ending_of(joint(False, ["third_order"])), ending_of(joint(False, ["third_order", "clipping"])),
    )  # fmt: skip
    assert unexplained is not None
    assert unexplained.end == "unexplained"
    assert alone is not None
    assert alone.end == "told_apart"
    assert open_ is None


def test_what_no_dwells_left_out_judge_is_named_and_said_to_be_unconfirmed() -> None:
    one = joint(False, ["cross_coupling"])
    one.document["classes"][0] |= {"scope": "sensor", "heldout_after_ug": None}
    one.document["recommended"] = []
    ending = ending_of(one)
    assert ending is not None
    assert ending.text.endswith("no dwells left out can judge cross_coupling: confirm with a fresh run")


def test_a_class_that_no_follow_up_parts_for_sure_is_not_called_impossible_to_part() -> None:
    group = ["third_order", "clipping"]
    assert "no follow-up was found" in no_follow_up(joint(False, group))
    assert no_follow_up(joint(False, group, twins=(("third_order", "clipping"),))).startswith("no measurement on this")


@pytest.mark.parametrize(("size", "possible"), [(1.15, True), (0.7, True), (0.022, False), (-1.0, False), (8.0, False)])
def test_a_device_that_had_not_soaked_follows_by_about_its_own_coefficients(size: float, *, possible: bool) -> None:
    assert NotSoaked().possible(np.array([size])) is possible


def test_the_name_of_an_unknown_plan_is_quoted_in_a_few_words() -> None:
    with pytest.raises(RecipeInvalid, match="no plan is called") as refused:
        _resolve("fibonacci" + "[" * 4000, "p", "poses", "recipe.toml")
    assert len(str(refused.value)) < 600
