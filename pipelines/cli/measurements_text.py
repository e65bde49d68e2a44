"""The next measurement as text: steps, station time, expected separation, and what no steps of the station separate."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.cli.options import console, print_table, short

if TYPE_CHECKING:
    from rich.console import Console


def measurements_table(proposed: list[dict[str, Any]], out: Console | None = None) -> None:
    """Print the next measurement step by step, with station time and expected separation.

    Parameters
    ----------
    out : standard output where None
    """
    steps = [p for p in proposed if p.get("measurable", True)]
    lines = [
        [
            short(p["outer_deg"]),
            short(p["inner_deg"]),
            short(p["chamber_C"]) + ("" if p.get("soaked", True) else " (during the ramp)"),
            short(p.get("wait_s")) + (f" after {short(p['off_s'] / 60.0)} min off" if p.get("off_s") else ""),
            str(p.get("repeats", 1)),
            p["why"],
        ]
        for p in steps
    ]
    where = out or console()
    if lines:
        columns = ["outer\n°", "inner\n°", "chamber\n°C", "wait\ns", "times", "purpose"]
        print_table(columns, lines, title="Measure next, in this order", out=out)
    for row in {p["why"]: p for p in steps if "minutes" in p}.values():
        where.print(brings(row), style="dim", soft_wrap=True)
    for row in proposed:
        if not row.get("measurable", True):
            where.print(row["why"], soft_wrap=True)


def brings(row: dict[str, Any]) -> str:
    """Station time and expected separation of the steps of a row."""
    text = f"{row['why']}: {short(row['minutes'])} min of station time; "
    expected = row.get("separation_if")
    if not expected:
        return text + (
            f"χ² of a coefficient of typical size {row['separation_before']:.1f} now, {row['separation_after']:.0f} expected"
        )
    after = ", ".join(f"{chi:.0f} if {name} is true" for name, chi in expected.items())
    text += f"χ² between the two {row['separation_before']:.1f} now, expected {after}"
    return text + (f"; not separated from the first: {', '.join(row['not_parted'])}" if row.get("not_parted") else "")
