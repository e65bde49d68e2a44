"""The basis of a verdict as text."""

from __future__ import annotations

from typing import Any

from inertial.counts import degrees_of_freedom
from pipelines.cli.options import console, short


def evidence_text(document: dict[str, Any]) -> str:
    """The basis of the verdict in one line; empty without a verdict."""
    evidence = document.get("evidence")
    if not evidence:
        return ""
    parts = [degrees_of_freedom(evidence["degrees_of_freedom"])]
    if evidence["condition"] is not None:
        parts.append(f"condition {short(evidence['condition'])}")
    if evidence["bias_jackknife_ug"] is not None and evidence["bias_change_by"] is not None:
        by = evidence["bias_change_by"]
        parts.append(
            f"bias ± {short(evidence['bias_jackknife_ug'])} µg by leaving out single dwells (most by dwell {by['dwell']} "
            f"of {by['unit']}: {short(evidence['bias_change_ug'])} µg)"
        )
    return "; ".join(parts)


def print_evidence(document: dict[str, Any]) -> None:
    """The basis of the verdict, and with few dwells the smallest effect that they show."""
    from inertial.criticism.evidence import FEW_DOF

    evidence, out = document.get("evidence"), console()
    if not evidence:
        return
    out.print(evidence_text(document), style="dim", soft_wrap=True)
    if document["adequate"] and evidence["degrees_of_freedom"] < FEW_DOF:
        smallest = evidence["smallest_cubic_ug"]
        seen = f"below {short(smallest)} µg/g³" if smallest is not None else "of any size"
        out.print(
            f"few dwells: a cubic term {seen} is not detected (probability 0.5)",
            style="dim",
        )
