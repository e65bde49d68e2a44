"""An improvement of a model for people: choices, error of each version, and the next command."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from inertial.counts import number_of
from pipelines.cli.chart import Line, chart
from pipelines.cli.next_commands import (
    FindData,
    Given,
    JudgedData,
    archive_words,
    command_line,
    fresh_measurement,
    print_next,
)
from pipelines.cli.printing import console, print_table, say, short, warn
from pipelines.cli.text.verdict_text import print_verdict
from pipelines.diagnosis import sections, sentences
from pipelines.improvement.documents import ImproveDocument, LadderRow, RecordingDocument

ERRORS = {
    "fitted_ug": "fitted to these dwells",
    "heldout_ug": "dwells left out: the worst of poses, soaks, stretches of time",
    "fresh_ug": "fresh run, coefficients unchanged",
    "noise_ug": "noise of the measurement",
}


def print_improvement(document: ImproveDocument) -> None:
    """Print what was added, the ladder of errors, and the next command; the diagnoses are printed as they are made."""
    _choices(document)
    _ladder(document["ladder"])
    warn(document["warnings"])
    print_next(document["next"])


def _choices(document: ImproveDocument) -> None:
    for choice in document["choices"]:
        effect, others = choice["effect"], ", ".join(choice["not_separated_from"])
        text = f"{document['file']}: added {effect}" if choice["added"] else f"{effect} is not added"
        if others:
            text += f"; these data do not separate it from {others}"
        if choice["decided_by"] == "undecided":
            text += "; --yes does not decide between them: name one with --effect"
        say(text, style="" if choice["added"] else "yellow")


def _ladder(rows: list[LadderRow]) -> None:
    if not rows:
        return
    heads = [f"version {row['version']}" + "".join(f"\n+ {name}" for name in row["added"]) for row in rows]
    lines = [
        [text, *(short(row[key]) for row in rows)]
        for key, text in ERRORS.items()
        if any(row[key] is not None for row in rows)
    ]
    print_table(["error, µg rms", *heads], lines, title="Error by version of the model", fixed=0)
    for row in rows[1:]:
        style = {True: "bold green", False: "bold red", None: "yellow"}[row["confirmed"]]
        say(f"{', '.join(row['added'])}: {row['text']}", style=style)


def next_lines(
    document: ImproveDocument, files: tuple[Path | None, Path], find: FindData, given: Given, repeated: Sequence[str]
) -> list[str]:
    """The commands to give next; empty where the model is adequate and a fresh run has judged it.

    files : the model that was judged, None for a list of effects, and the model file to write
    repeated : options of ``improve`` that name the file to write and the author, as they were given
    """
    from pipelines.cli.history import removal

    (model, target), after = files, document["after"] or document["diagnosis"]
    if document["refuted"]:
        return [removal(target, given.effect_files, effect) for effect in document["refuted"]]
    left = [c for c in document["choices"] if not c["added"]]
    if not (left or after["recommended"] or (document["added"] and not document["fresh"])):
        return []
    data = find()
    judged = target if document["added"] else model
    model_option = ["--model", str(judged)] if judged else ["--effects", ",".join(document["effects"])]
    again = ["improve", data.source, *model_option, *data.options, *([] if data.measure else data.again), *repeated]
    if left:
        names = (left[0]["effect"], *left[0]["not_separated_from"])
        return [command_line(*again, "--effect", name) for name in names]
    lines = fresh_measurement(target, data) if document["added"] and not document["fresh"] else []
    return [*lines, command_line(*again)] if after["recommended"] else lines


HEIGHT, WIDTH = 7, 100
MOST_REMARKS = 4
_POSED = {"force_x", "outer", "tilt"}
"""Columns of a reference: the outputs of its poses are no drift."""
STYLES = ("cyan", "green", "magenta")


def print_recording(document: ImproveDocument) -> None:
    """Print an improvement that began with a recording."""
    recording, judged = document.get("recording"), document["after"] or document["diagnosis"]
    if recording is None:
        return
    _recognised(recording)
    print_verdict(judged)
    if not document["added"]:  # residuals and coefficients are those of the model of the import
        _picture(recording)
    for line in recording["lines"]:
        if line.startswith("CHECK") or (": bias" in line and not document["added"]):
            say(f"  {line}", style="yellow" if line.startswith("CHECK") else "")
    basis = sentences.evidence_text(judged), sentences.undetected(judged), sentences.slow_noise(judged)
    for text in filter(None, basis):
        say(f"  {text}", style="dim")
    _missing(document)
    for text in sections.unseen(judged, brief=True).notes:
        say(f"  {text}", style="dim")
    print_next(document["next"])


def next_of_recording(
    document: ImproveDocument, recording: RecordingDocument, given: Given, model: Sequence[str], repeated: Sequence[str]
) -> list[str]:
    """The commands to give next: the fit of a changed model; without faulty dwells, else the coefficients, else the diagnosis.

    A fault from one dwell on, or of all dwells of a unit, leaves none to go on with: the diagnosis shows where it begins.

    model, repeated : options of ``improve``: the model that was judged; the file to write and the author
    """
    data = JudgedData(recording["run"], "", given.fresh, given.fresh_history, given=given)
    run, words = data.source, archive_words(given.archive)
    if document["added"]:
        return [command_line("fit", run, "--model", str(document["file"]), *data.options), *document["next"]]
    if document["next"]:
        return document["next"]
    judged = document["after"] or document["diagnosis"]
    left = [f"{entry['unit']}:{entry['dwell']}" for entry in (judged["leave_out"] or {"dwells": []})["dwells"]]
    for fault in judged["blocked_by"]:
        left += [f"{unit}:{dwell}" for unit in fault["units"] for dwell in fault["dwells"]]
    if left:
        without = replace(given, leave_out=",".join(dict.fromkeys([*filter(None, [given.leave_out]), *left])))
        option_words = [*model, *replace(data, given=without).options, *data.again, *repeated]
        return [command_line("improve", run, *option_words)]
    if recording["fit"] is None and judged["adequate"] is not False:
        return [command_line("fit", run, "--effects", ",".join(document["effects"]), *words)]
    if judged["adequate"]:
        return [command_line("export", run, "--format", "csv", *words)]
    return [command_line("diagnose", run, "--all", *model, *data.options)]


def _recognised(recording: RecordingDocument) -> None:
    rate = "" if recording["rate_hz"] is None else f", {recording['rate_hz']:.5g} Hz"
    axes = [axis for axis in "xyz" if axis in recording["columns"]]
    columns = ", ".join(recording["columns"][axis] for axis in axes)
    rows = f"{recording['rows']} rows{rate}; {number_of(recording['dwells'], 'dwell')}"
    say(f"{', '.join(recording['files'])}: {recording['form']}, {rows}")
    say(
        f"  {', '.join(axes)}: {columns} ({recording['reason']}); in {recording['output_unit']}: {recording['output_reason']}",
        style="dim",
    )
    for text in [*recording["assumed"], *recording["remarks"]][:MOST_REMARKS]:
        say(f"  {text}", style="dim")
    say(recording["command"])
    say(f"  kept as run {recording['run']}", style="dim")


def _picture(recording: RecordingDocument) -> None:
    """The residual of the norm by dwell, or the drift of the outputs of one pose."""
    rows = recording["dwell_list"]
    if len(rows) < 3 or recording["fit"] == "faces" or _POSED & set(recording["columns"]):
        return
    times = [0.5 * (row["start_s"] + row["end_s"]) for row in rows]
    if rows[0]["residual_ug"] is not None:
        title, unit = "residual of the norm by dwell, mg", 1e-3
        lines = [Line("residual", "cyan", [(t, unit * row["residual_ug"]) for t, row in zip(times, rows, strict=True)])]
    else:
        first = rows[0]["mean"]
        title = f"output since the first block, thousandths of {recording['output_unit']}"
        lines = [
            Line(axis, style, [(t, 1e3 * (row["mean"][k] - first[k])) for t, row in zip(times, rows, strict=True)])
            for k, (axis, style) in enumerate(zip("xyz", STYLES, strict=True))
        ]
    width = min(WIDTH, console().width)
    console().print(chart(title, lines, width, HEIGHT, (times[0], times[-1])), end="")


def _missing(document: ImproveDocument) -> None:
    """Print missing effects, added effects, and the errors on dwells that were left out."""
    for choice in document["choices"]:
        others = ", ".join(choice["not_separated_from"])
        class_note = f" (these data do not separate it from {others})" if others else ""
        say(f"  missing: {choice['effect']}{class_note}; {'added' if choice['added'] else 'not added'}", style="yellow")
    for text in sections.fault_lines(document["diagnosis"]):
        say(f"  {text}", style="bold red")
    if document["diagnosis"]["unexplained"]:
        say(f"  {sentences.UNEXPLAINED}: {sentences.unexplained_text(document['diagnosis'])}", style="yellow")
    for text in sentences.left_out(document["diagnosis"]):
        say(f"  {text}", style="yellow")
    for row in document["ladder"]:
        known = row["heldout_ug"] is not None and math.isfinite(row["heldout_ug"])
        held = "" if not known else f", {row['heldout_ug']:.0f} µg of dwells predicted by a fit without them"
        added = f" with {', '.join(row['added'])}" if row["added"] else ""
        say(f"  rms error{added}: {row['fitted_ug']:.0f} µg of the fitted dwells{held}; noise {row['noise_ug']:.0f} µg")
