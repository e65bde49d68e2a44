"""``tumbleline inspect``: the content of files of other systems, and the import command for them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from inertial.counts import number_of
from pipelines.cli.options import PAGES, PICTURES, READING, JsonOption, argument, option, outputs, set_option, settings
from pipelines.cli.printing import conclude, error_console, print_table, publish, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.importers.documents import InspectDocument
    from pipelines.importers.inspection import Inspection

PART = "Start here"
ORDER = 30
SUMMARY = "Look at recordings of other systems and propose how to import them."
EXAMPLES = ("tumbleline inspect recording.csv", "tumbleline inspect part-1.csv part-2.csv --set join=rows")

MOST_INTERVALS, MOST_FAULTS = 12, 6
NUMBERS: tuple[tuple[Literal["low", "high", "resolution"], int], ...] = (("low", 6), ("high", 6), ("resolution", 4))
"""Numbers of a column, with their digits."""


def command(
    files: Annotated[list[Path], argument("FILE…", "Recordings in any format that import reads.")],
    setting: Annotated[list[str] | None, set_option(READING)] = None,
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE",
            "Picture of the record (.svg, .png, .pdf), or the result as a page (.html); may be repeated.",
        ),
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show the content of a file and its probable meaning, with reasons: columns, units, rate, gaps, faults, static intervals.

    Nothing is stored. The last line is the import command; values that the file does not state are in capitals. A table of
    dwells in the exchange format needs no import: the last line is then 'tumbleline diagnose FILE'. Exit status 1: values are
    missing, or the table cannot be used.
    """
    from pipelines.importers import limited

    limited.start()
    from pipelines.importers.inspection import inspect

    paths_of = outputs(output, {"picture": PICTURES, "page": PAGES}, "inspect")
    picture, page = paths_of.get("picture"), paths_of.get("page")
    given = settings(setting, READING, "inspect")
    join, group = given.get("join", ""), given.get("group", "")
    if join not in {"", "rows", "columns"}:
        raise WrongUse(f"--set join: found '{join}', rows or columns is needed; correct it")
    sets = [files] if join or len(files) == 1 else [[path] for path in files]
    if len(sets) > 1 and (picture or page):
        raise WrongUse(
            f"inspect: {len(sets)} recordings, --output shows one; name one file, or add --set join=rows|columns"
        )
    inspections: list[Inspection] = []
    for paths in sets:
        with error_console().status(f"reading {paths[0].name}"):
            inspections.append(inspect(paths, join=join, group=group))
    if picture or page:
        _write(inspections[0], picture, page)
    documents = [inspection.document for inspection in inspections]
    result = documents[0] if len(documents) == 1 else {"inspections": documents}
    passed = not any(document["open"] for document in documents)
    conclude(result, lambda _: _print_all(documents), as_json=as_json, passed=passed)


def _print_all(documents: list[InspectDocument]) -> None:
    if len(documents) > 1:
        say(
            f"{len(documents)} recordings; if they are parts of one, add --set join=rows (one after the other) or "
            "--set join=columns (side by side)"
        )
    for document in documents:
        _print(document)


def _write(inspection: Inspection, picture: Path | None, page: Path | None) -> None:
    from pipelines.report import recording

    if picture is not None:
        from pipelines.drawing.picture import picture as drawn

        chart = recording.chart_of(inspection)
        if chart is None:
            raise WrongUse(
                "inspect: no samples of acceleration over time were recognised, nothing can be drawn; leave out the picture"
            )
        publish(picture, drawn(chart, picture.suffix.lower()), "picture")
    if page is not None:
        publish(page, recording.page(inspection), "page")


def _print(document: InspectDocument) -> None:
    names = " + ".join(Path(name).name for name in document["files"])
    rate = "" if document["rate_hz"] is None else f", {document['rate_hz']:.5g} Hz"
    long = "" if document["duration_s"] is None else f", {document['duration_s']:.5g} s"
    say(f"{names}: {document['form']}, {document['rows']} rows{rate}{long}")
    for remark in document["remarks"]:
        say(f"  {remark}")
    _print_columns(document)
    if document["output_unit"]:
        say(f"  output in {document['output_unit']}: {document['output_reason']}")
    if document["time_unit"]:
        say(f"  time in {document['time_unit']}: {document['time_reason']}")
    if document["gaps"]:
        say(f"  {number_of(document['gaps'], 'gap')} in time longer than five samples")
    for column in document["columns"]:
        if column["clipped"] and column["low"] is not None and column["high"] is not None:
            say(
                f"  axis {column['meaning']} is clipped: {number_of(column['clipped'], 'sample')} in runs at the end of its "
                f"range ({column['low']:g} to {column['high']:g}); the true output is beyond"
            )
    for fault in document["faults"][:MOST_FAULTS]:
        what = "is constant" if fault["fault"] == "stuck_output" else "has torn words"
        say(f"  axis {fault['axis']} {what}: {fault['samples']} samples from row {fault['first_row']} on")
    more = len(document["faults"]) - MOST_FAULTS
    if more > 0:
        say(f"  and {more} more such faults")
    _print_intervals(document)
    for text in document["open"]:
        say(f"  to be added by you: {text}")
    say(document["command"])


def _print_columns(document: InspectDocument) -> None:
    rows = [
        [
            str(column["number"]),
            column["name"],
            column["meaning"],
            column["reason"],
            column["unit"],
            *("" if column[key] is None else f"{column[key]:.{digits}g}" for key, digits in NUMBERS),
            str(column["clipped"] or ""),
            str(column["missing"] or ""),
        ]
        for column in document["columns"]
    ]
    heads = ["no.", "column", "meaning", "reason", "unit", "lowest", "highest", "resolution", "clipped", "no number"]
    print_table(heads, rows, fixed=2)


def _print_intervals(document: InspectDocument) -> None:
    intervals = document["intervals"]
    if not intervals:
        return
    total = sum(interval["end_s"] - interval["start_s"] for interval in intervals)
    say(f"  {number_of(len(intervals), 'static interval')}, {total:.4g} s")
    for k in [k for k, interval in enumerate(intervals) if interval["positions"] > 1][:MOST_FAULTS]:
        say(f"  interval {k} holds about {intervals[k]['positions']} positions logged back to back")
    rows = [
        [
            str(k),
            f"{interval['start_s']:.2f}",
            f"{interval['end_s']:.2f}",
            str(interval["samples"]),
            " / ".join(f"{value:.6g}" for value in interval["mean"]),
            " / ".join(f"{value:.3g}" for value in interval["sd"]),
        ]
        for k, interval in enumerate(intervals[:MOST_INTERVALS])
    ]
    print_table(["interval", "start, s", "end, s", "samples", "mean x / y / z", "sd x / y / z"], rows)
    if len(intervals) > MOST_INTERVALS:
        say(f"  and {len(intervals) - MOST_INTERVALS} more")
