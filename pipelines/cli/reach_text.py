"""The uncertainty that a plan can reach, as text."""

from __future__ import annotations

from typing import Any

from pipelines.cli.options import console, print_table, short
from schemas.decisions import LARGEST_ERROR

TITLES = {
    "bias": "bias",
    "scale": "scale",
    "misalignment": "misalignment",
    "bias_temperature": "bias over temperature",
    "scale_temperature": "scale over temperature",
    "verification_norm": "magnitude in a verification pose",
    "bias_error": "error by the references alone",
    "bias_error_period": "error over the period, RMS",
    LARGEST_ERROR: "largest error of an axis over the period, 95 % bound",
}
LEAST = 0.01
"""Smallest share of a contribution that is printed."""


def print_reach(reach: dict[str, Any] | None) -> None:
    """A table of the quantities with their largest contributions, limits that cannot be met, and remarks."""
    out = console()
    if reach is None:
        out.print(
            "uncertainty: noise only, the station states no [uncertainty]; no grade above consumer, no certificate"
        )
        return
    worst: dict[str, dict[str, Any]] = {}
    for row in reach["quantities"]:
        if row["quantity"] not in worst or row["u"] > worst[row["quantity"]]["u"]:
            worst[row["quantity"]] = row
    print_table(["quantity, worst axis", "axis", "u", "U, k = 2", "unit"], [_line(row) for row in worst.values()])
    for row in worst.values():
        rulers = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in row["shares"].items() if share >= LEAST)
        out.print(f"{TITLES[row['quantity']]}: {rulers or 'no contribution'}", markup=False, soft_wrap=True)
    period = f"period of validity {reach['validity_months']} months, frame {reach['frame']}"
    out.print(f"{period}; references by {reach['grade_source'].replace('_', ' ')}", style="dim", markup=False)
    if reach["grade_source"] == "assumed":
        out.print("references: assumed values, which allow no certificate", markup=False)
    for name, rules in reach["not_stated"].items():
        out.print(f"not stated: {name} (dominates {rules})", markup=False)
    for line in (*reach["remarks"], *(f"cannot be met: {one}" for one in reach["unreachable"])):
        out.print(line, markup=False, soft_wrap=True)


def _line(row: dict[str, Any]) -> list[str]:
    expanded = "" if row["quantity"] in {"bias_error_period", LARGEST_ERROR} else short(row["expanded"])
    return [TITLES[row["quantity"]], row["axis"], short(row["u"]), expanded, row["unit"]]
