"""The basis of a verdict as text."""

from __future__ import annotations

from typing import Any

from inertial.counts import degrees_of_freedom
from pipelines.cli.options import console, short


def evidence_text(document: dict[str, Any]) -> str:
    """The basis of the verdict in one line; empty without a verdict."""
    found = document.get("evidence")
    if not found:
        return ""
    parts = [degrees_of_freedom(found["degrees_of_freedom"])]
    if found["condition"] is not None:
        parts.append(f"condition {short(found['condition'])}")
    if found["bias_jackknife_ug"] is not None and found["bias_change_by"] is not None:
        by = found["bias_change_by"]
        parts.append(
            f"bias ± {short(found['bias_jackknife_ug'])} µg by leaving out single dwells (most by dwell {by['dwell']} "
            f"of {by['unit']}: {short(found['bias_change_ug'])} µg)"
        )
    return "; ".join(parts)


def print_evidence(document: dict[str, Any]) -> None:
    """The basis of the verdict, and with few dwells the smallest effect that they show."""
    from inertial.criticism.evidence import FEW_DOF

    found, out = document.get("evidence"), console()
    if not found:
        return
    out.print(evidence_text(document), style="dim", markup=False, soft_wrap=True)
    if document["adequate"] and found["degrees_of_freedom"] < FEW_DOF:
        smallest = found["smallest_cubic_ug"]
        seen = f"below {short(smallest)} µg/g³" if smallest is not None else "of any size"
        out.print(
            f"few dwells: a cubic term {seen} is not detected (probability 0.5)",
            style="dim",
            markup=False,
            soft_wrap=True,
        )
