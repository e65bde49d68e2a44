"""``tumbleline plan line``: the shortest schedule of lots over the fixtures of a line that share a table."""

from pathlib import Path
from typing import Annotated

from pipelines.cli import options
from pipelines.cli.options import argument, option
from pipelines.cli.printing import give, print_table, publish, say
from pipelines.planning.documents import LineActivity, LineDocument, LineResource

PICTURE, CSV = "picture", "csv"


def line_schedule(
    file: Annotated[Path, argument("LINE.toml", "The line: fixtures, what they share, operators, lots.")],
    output: Annotated[
        list[Path] | None,
        option("--output -o FILE", "Every step (.csv), and a picture (.svg, .png, .pdf); may be repeated."),
    ] = None,
    archive: options.ArchiveOption = None,
    *,
    everything: options.AllOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Show the shortest schedule of the lots of a line: one lot is measured while others soak.

    Durations are those that 'plan' predicts for each recipe. Beside it: one lot after the other, and what bounds both.
    """
    from pipelines.jobs.releases import planned_recipe
    from pipelines.planning.line_document import plan_line
    from pipelines.report.line_chart import line_csv
    from schemas.foreign import is_file
    from schemas.line import Line
    from schemas.station import load_station
    from schemas.toml_files import parse_as, read_text

    made = options.outputs(output, {CSV: (".csv",), PICTURE: options.PICTURES}, "plan line")
    line = parse_as(Line, read_text(file, "line"), f"line {file.name}")

    def beside(name: str) -> str:
        """A file beside that of the line; else a name or a path as everywhere."""
        return str(file.parent / name) if is_file(file.parent / name) else name

    station = load_station(Path(beside(line.station)) if line.station else None)
    document = plan_line(line, station, lambda name: planned_recipe(beside(name), "", None, archive, station.name))
    contents = {kind: line_csv(document) if kind == CSV else _drawn(document, path) for kind, path in made.items()}
    for kind, path in made.items():
        publish(path, contents[kind], kind)
    give(document, lambda schedule: _print(schedule, everything=everything), as_json=as_json)


def _drawn(document: LineDocument, path: Path) -> bytes:
    from pipelines.drawing.picture import picture
    from pipelines.report.line_chart import line_chart

    return picture(line_chart(document), path.suffix.lower())


def clock(document: LineDocument, minutes: float) -> str:
    """The time of day, some minutes after the start; days later before it."""
    days, rest = divmod(document["start_min"] + minutes, 24 * 60)
    return f"{f'+{days:.0f} d ' if days else ''}{int(rest // 60):02d}:{int(rest % 60):02d}"


def _print(document: LineDocument, *, everything: bool) -> None:
    lots, alone = len(document["lots"]), document["one_after_another"]
    least = (
        "this is the shortest schedule" if document["proven"] else f"none has less than {document['bound_min']:.0f} min"
    )
    say(
        f"{document['line']}: {lots} lots in {document['makespan_min']:.0f} min, {document['minutes_per_lot']:.1f} min per lot, "
        f"{document['lots_per_day']:.1f} lots a day; {least} with a change before each stay"
    )
    this = ": this is the schedule" if alone["makespan_min"] == document["makespan_min"] else ""
    say(f"one after the other: {alone['makespan_min']:.0f} min, {alone['minutes_per_lot']:.1f} min per lot{this}")
    print_table(
        ["critical first", "number", "needed,\nmin per lot", "no less than,\nmin per lot"],
        [
            [row["resource"], str(row["count"]), f"{row['minutes_per_lot']:.1f}", f"{row['bound_per_lot_min']:.1f}"]
            for row in document["resources"]
        ],
    )
    shared = _shared(document["resources"])
    print_table(
        ["lot", "fixture", "loaded", *(f"on {name}" for name in shared), "unloaded", "waits, min"],
        [
            [
                lot["lot"],
                lot["fixture"],
                clock(document, lot["loaded_min"]),
                *(_held(document, lot["lot"], name) for name in shared),
                clock(document, lot["unloaded_min"]),
                f"{lot['wait_min']:.0f}",
            ]
            for lot in document["lots"]
        ],
    )
    if everything:
        print_table(
            ["from", "to", "lot", "fixture", "step", "°C", "holds"],
            [_step(document, activity) for activity in document["activities"]],
        )


def _shared(resources: list[LineResource]) -> list[str]:
    from schemas.line import FIXTURES, OPERATOR

    return [row["resource"] for row in resources if row["resource"] not in {FIXTURES, OPERATOR}]


def _held(document: LineDocument, lot: str, resource: str) -> str:
    """When a lot is on a shared resource, changes not counted; what follows at once is one stay."""
    spans: list[tuple[float, float]] = []
    for activity in document["activities"]:
        if activity["lot"] == lot and resource in activity["resources"] and activity["activity"] != "change":
            begin = spans.pop()[0] if spans and spans[-1][1] >= activity["begin_min"] else activity["begin_min"]
            spans.append((begin, activity["end_min"]))
    return ", ".join(f"{clock(document, begin)}–{clock(document, end)}" for begin, end in spans)


def _step(document: LineDocument, activity: LineActivity) -> list[str]:
    temperature = activity["temperature_C"]
    return [
        clock(document, activity["begin_min"]),
        clock(document, activity["end_min"]),
        activity["lot"],
        activity["fixture"],
        activity["activity"],
        "" if temperature is None else f"{temperature:g}",
        ", ".join(activity["resources"]),
    ]
