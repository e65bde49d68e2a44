"""Why an inquiry ends without a follow-up."""

from types import SimpleNamespace
from typing import Literal

import numpy as np

from inertial.data_errors.handling.not_soaked import NotSoaked
from pipelines.inquiry.inquiry import NO_FOLLOW_UP, ending_of


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
    classes = {
        None: "not_judged",
        (): "unexplained",
        (("third_order",),): "told_apart",
        (("third_order", "clipping"),): None,
    }
    for groups, end in classes.items():
        ending = ending_of(joint(None) if groups is None else joint(False, *map(list, groups)))
        assert (ending.end if ending else None) == end


def test_a_device_that_had_not_soaked_follows_by_about_its_own_coefficients() -> None:
    sizes = {1.15: True, 0.7: True, 0.022: False, -1.0: False, 8.0: False}
    assert {size: NotSoaked().possible(np.array([size])) for size in sizes} == sizes
