"""Options and arguments that several commands share."""

from pathlib import Path
from typing import Annotated, Any

import typer


def option(notation: str, text: str, **checks: Any) -> Any:
    """An option of a command.

    notation : its names, then what stands for its value, as the help shows them: ``--output -o FILE``
    text : what it does
    checks : ``min``, ``max``, ``callback`` and others of :class:`typer.Option`
    """
    words = notation.split()
    names = [word for word in words if word.startswith("-")]
    return typer.Option(*names, metavar=" ".join(words[len(names) :]) or None, help=text, **checks)


def argument(notation: str, text: str) -> Any:
    """An argument of a command: what stands for it in the help, and what it is."""
    return typer.Argument(metavar=notation, help=text)


def names_in(listed: str) -> tuple[str, ...]:
    """The names that an option lists, divided by commas, each once."""
    return tuple(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))


ArchiveOption = Annotated[
    str | None,
    option("--archive DIR", "Folder or address (s3://…) of the archive; TUMBLELINE_ARCHIVE or ./archive by default."),
]
AllOption = Annotated[bool, option("--all", "Print the long tables, too.")]
RecordOption = Annotated[Path | None, option("--record FILE", "Record every frame on the links into this new file.")]
JsonOption = Annotated[bool, option("--json", "Print one JSON document and nothing else.")]
RecipeArgument = Annotated[str, argument("[RECIPE]", "A recipe file or a built-in recipe.")]
StationOption = Annotated[Path | None, option("--station FILE", "The station; the built-in simulated one by default.")]
SeedOption = Annotated[int | None, option("--seed", "Seed of a simulated station.")]
RepeatOption = Annotated[
    int, option("--repeat", "Count of fresh measurements of the same lot: 1, 2, … measure it anew.", min=0)
]
RunArgument = Annotated[str, argument("RUN", "A run's name, its beginning, or 'latest'.")]
DwellsArgument = Annotated[str, argument("DWELLS", "A file in the exchange format, or a run of the archive.")]
EffectsOption = Annotated[
    str,
    option(
        "--effects a,b,c",
        "The model as a list of effects; by default the run's own, for a file a plain or thermal one.",
    ),
]
ModelOption = Annotated[Path | None, option("--model FILE", "The model as a model file.")]
HistoryOption = Annotated[str, option("--history FILE", "Temperatures against time; a run of the archive has its own.")]
JoinOption = Annotated[str, option("--join rows|columns", "Join several files into one recording.")]
GroupOption = Annotated[str, option("--group NAME", "Group of channels, if the file has several.")]
ByOption = Annotated[str, option("--by NAME", "Author of the change; the user's name by default.")]
FreshOption = Annotated[str, option("--fresh DWELLS2", "The same units measured again: never fitted, only predicted.")]
FreshHistoryOption = Annotated[str, option("--fresh-history FILE", "Temperatures against time of the fresh run.")]
OtherEffectsOption = Annotated[str, option("--effects a,b,c", "Another model, as a list of effects.")]
OtherLimitsOption = Annotated[str, option("--limits FILE", "Other limits: a file or a name.")]
SeriesArgument = Annotated[str, argument("FILE|RUN", "A file of samples at rest, or a run of the archive.")]
SeriesColumnsOption = Annotated[
    str, option("--columns x,y,z", "Columns of the file, or their numbers from 1; all numbers by default.")
]
TimeColumnOption = Annotated[str, option("--time COLUMN", "Column of the time; or give --rate.")]
TimeUnitOption = Annotated[str, option("--time-unit s|ms|us|ns", "Unit of the time column.")]
RateOption = Annotated[float | None, option("--rate HZ", "Sampling rate.", min=1e-9)]
SeriesUnitOption = Annotated[str, option("--unit UNIT", "Unit of the output, as it is printed.")]
StretchOption = Annotated[
    int | None, option("--stretch N", "Stretch at rest of an import; the longest by default.", min=1)
]
PlotOption = Annotated[Path | None, option("--plot FILE.png", "Draw it, as PNG, SVG or PDF.")]
PageOption = Annotated[Path | None, option("--page FILE.html", "Write it with its tables, as HTML.")]
LeaveOutOption = Annotated[str, option("--leave-out UNIT:DWELL,…", "Dwells that are not judged or fitted.")]
EffectFileOption = Annotated[
    list[Path] | None, option("--effect-file FILE.py", "A Python file with effects of your own; may be repeated.")
]
FormulaOption = Annotated[
    list[str] | None,
    option(
        "--formula ID=EXPRESSION",
        "An effect as a formula over recorded quantities, to be named in --effects; may be repeated.",
    ),
]
SelectionArgument = Annotated[
    list[str],
    argument(
        "SELECTION…",
        "Names of runs or their beginnings, 'latest', 'all', device:…, station:…, unit:…, recipe:…, since:DATE, until:DATE.",
    ),
]
CalibrationOption = Annotated[str, option("--calibration RUN:UNIT", "The calibration: a run and one of its units.")]
DaskOption = Annotated[
    str, option("--dask ADDRESS|local", "Work on Dask workers: of the scheduler at an address, or started here.")
]
WorkersOption = Annotated[
    int | None, option("--workers", "Processes on this machine; as many as it has cores by default.", min=1)
]
SimulatedDeviceOption = Annotated[str, option("--device", "Preset of the simulated devices under test.")]
SimulatedUnitsOption = Annotated[int, option("--units", "Number of simulated devices in the slots.", min=1, max=32)]
