"""A recording of another system on one screen: what it is, the verdict, a picture, coefficients, what is missing, what next."""

from __future__ import annotations

import math
from typing import Any

from inertial.counts import number_of
from pipelines.cli.chart import Line, chart
from pipelines.cli.next_commands import archive_words, command_line, print_next
from pipelines.cli.printing import console, say
from pipelines.cli.text.verdict_text import print_verdict
from pipelines.diagnosis import sections, sentences

HEIGHT, WIDTH = 7, 100
MOST_REMARKS = 4
STYLES = ("cyan", "green", "magenta")


def print_recording(document: dict[str, Any]) -> None:
    """Print an improvement that began with a recording."""
    one, judged = document["recording"], document["after"] or document["diagnosis"]
    _recognised(one)
    print_verdict(judged)
    _picture(one)
    for line in one["lines"]:
        if line.startswith("CHECK") or ": bias" in line:
            say(f"  {line}", style="yellow" if line.startswith("CHECK") else "")
    for text in filter(None, (sentences.evidence_text(judged), sentences.undetected(judged))):
        say(f"  {text}", style="dim")
    _missing(document)
    for text in sections.unseen(judged, brief=True).notes:
        say(f"  {text}", style="dim")
    print_next(document["next"])


def next_of_recording(document: dict[str, Any], archive: str | None) -> list[str]:
    """The command to give next: without faulty dwells, else the coefficients, else the whole diagnosis."""
    run, words = document["recording"]["run"], archive_words(archive)
    judged = document["after"] or document["diagnosis"]
    left = [f"{one['unit']}:{one['dwell']}" for one in (judged["leave_out"] or {"dwells": []})["dwells"]]
    for fault in judged["blocked_by"]:
        left += [f"{unit}:{dwell}" for unit in fault["units"] for dwell in fault["dwells"]]
    if left:
        return [command_line("improve", run, "--leave-out", ",".join(dict.fromkeys(left)), *words)]
    if judged["adequate"] and document["recording"]["fit"]:
        return [command_line("export", run, "--format", "csv", *words)]
    return [command_line("diagnose", run, "--all", *words)]


def _recognised(one: dict[str, Any]) -> None:
    rate = "" if one["rate_hz"] is None else f", {one['rate_hz']:.5g} Hz"
    axes = ", ".join(one["columns"][axis] for axis in "xyz")
    say(f"{', '.join(one['files'])}: {one['form']}, {one['rows']} rows{rate}; {number_of(one['dwells'], 'dwell')}")
    say(f"  x, y, z: {axes} ({one['reason']}); in {one['output_unit']}: {one['output_reason']}", style="dim")
    for text in [*one["assumed"], *one["remarks"]][:MOST_REMARKS]:
        say(f"  {text}", style="dim")
    say(one["command"])
    say(f"  kept as run {one['run']}", style="dim")


def _picture(one: dict[str, Any]) -> None:
    """The residual of the norm by dwell, or the drift of the outputs where no norm was fitted."""
    rows = one["dwell_list"]
    if len(rows) < 3 or one["fit"] == "faces":
        return
    times = [0.5 * (row["start_s"] + row["end_s"]) for row in rows]
    if rows[0]["residual_ug"] is not None:
        title, unit = "residual of the norm by dwell, mg", 1e-3
        lines = [Line("residual", "cyan", [(t, unit * row["residual_ug"]) for t, row in zip(times, rows, strict=True)])]
    else:
        first = rows[0]["mean"]
        title = f"output since the first block, thousandths of {one['output_unit']}"
        lines = [
            Line(axis, style, [(t, 1e3 * (row["mean"][k] - first[k])) for t, row in zip(times, rows, strict=True)])
            for k, (axis, style) in enumerate(zip("xyz", STYLES, strict=True))
        ]
    width = min(WIDTH, console().width)
    console().print(chart(title, lines, width, HEIGHT, (times[0], times[-1])), end="")


def _missing(document: dict[str, Any]) -> None:
    """What is missing, what was added, and the errors on dwells that were left out."""
    for choice in document["choices"]:
        others = ", ".join(choice["not_separated_from"])
        alike = f" (these data do not separate it from {others})" if others else ""
        say(f"  missing: {choice['effect']}{alike}; {'added' if choice['added'] else 'not added'}", style="yellow")
    for fault in document["diagnosis"]["blocked_by"]:
        dwells = ", ".join(map(str, fault["dwells"])) or "all"
        say(f"  data fault {fault['fault']}, dwells {dwells}: {fault['evidence']}", style="bold red")
    unexplained = document["diagnosis"]["unexplained"]
    if unexplained:
        say(f"  {sentences.UNEXPLAINED}: {sentences.unexplained_text(document['diagnosis'])}", style="yellow")
    for text in sentences.left_out(document["diagnosis"]):
        say(f"  {text}", style="yellow")
    for row in document["ladder"]:
        known = row["heldout_ug"] is not None and math.isfinite(row["heldout_ug"])
        held = "" if not known else f", on dwells left out {row['heldout_ug']:.0f} µg"
        added = f" with {', '.join(row['added'])}" if row["added"] else ""
        say(f"  error{added}: fitted {row['fitted_ug']:.0f} µg{held}; noise {row['noise_ug']:.0f} µg")
