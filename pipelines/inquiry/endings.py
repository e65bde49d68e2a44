"""Reasons for the end of an inquiry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from pipelines.inquiry.lineage import JointDiagnosis

End = Literal[
    "adequate", "told_apart", "nothing_parts", "budget", "declined", "asked", "blocked", "not_judged", "unexplained"
]


NO_FOLLOW_UP: frozenset[End] = frozenset({"blocked", "not_judged"})
"""Endings after which nothing is measured for effects that are not visible: the data do not judge the model at all."""


@dataclass(frozen=True)
class Ending:
    """Reason for the end of an inquiry."""

    end: End
    text: str


def ending_of(joint: JointDiagnosis) -> Ending | None:
    """The ending that a joint diagnosis leads to; None if the inquiry continues."""
    document = joint.document
    if joint.diagnosis is None:
        return Ending("blocked", "every unit has a data fault; correct it, then diagnose again")
    if document["adequate"]:
        return Ending("adequate", "the model is adequate: the residuals are at the noise floor")
    if document["adequate"] is None:
        return Ending("not_judged", f"the model cannot be judged: {document['reason']}")
    if joint.ambiguous:
        return None
    if not document["classes"]:
        return Ending("unexplained", "the model is not adequate, and no effect of the catalogue explains the residuals")
    return Ending("told_apart", _all_identified(document))


def _all_identified(document: dict[str, Any]) -> str:
    """Every class has one effect; those that no dwells left out can judge are told."""
    groups = document["classes"]
    text = f"every class contains one effect: {', '.join(g['effects'][0] for g in groups)}"
    unjudged = [g["effects"][0] for g in groups if g.get("scope") != "data" and g.get("heldout_after_ug", 0.0) is None]
    if not unjudged:
        return text
    return f"{text}; no dwells left out can judge {', '.join(unjudged)}: confirm with a fresh run"


def no_follow_up(joint: JointDiagnosis) -> str:
    """Reason for no follow-up: no measurement of the station separates a class, or none is certain enough."""
    if any(joint.following.twins):
        return f"no measurement on this station discriminates between {ambiguous_classes(joint)}"
    return (
        f"no follow-up was found that is expected to discriminate between {ambiguous_classes(joint)}: they differ too little "
        "beside the noise; measure the plan again with longer dwells, or more units"
    )


def ambiguous_classes(joint: JointDiagnosis) -> str:
    """The classes of more than one effect as text."""
    return ", and ".join(" | ".join(group) for group in joint.ambiguous)
