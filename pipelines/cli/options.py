"""Options and arguments that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

ArchiveOption = Annotated[
    str | None,
    typer.Option(
        "--archive",
        metavar="DIR",
        help="Folder or address (s3://…) of the archive; TUMBLELINE_ARCHIVE or ./archive by default.",
    ),
]
AllOption = Annotated[bool, typer.Option("--all", help="Print the long tables, too.")]
RecordOption = Annotated[
    Path | None,
    typer.Option("--record", metavar="FILE", help="Record every frame on the links into this new file."),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
RecipeArgument = Annotated[str, typer.Argument(metavar="[RECIPE]", help="A recipe file or a built-in recipe.")]
StationOption = Annotated[
    Path | None,
    typer.Option("--station", metavar="FILE", help="The station; the built-in simulated one by default."),
]
SeedOption = Annotated[int | None, typer.Option("--seed", help="Seed of a simulated station.")]
RepeatOption = Annotated[
    int, typer.Option("--repeat", min=0, help="Count of fresh measurements of the same lot: 1, 2, … measure it anew.")
]
RunArgument = Annotated[str, typer.Argument(metavar="RUN", help="A run's name, its beginning, or 'latest'.")]
DwellsArgument = Annotated[
    str, typer.Argument(metavar="DWELLS", help="A file in the exchange format, or a run of the archive.")
]
EffectsOption = Annotated[
    str,
    typer.Option(
        "--effects",
        metavar="a,b,c",
        help="The model as a list of effects; by default the run's own, for a file a plain or thermal one.",
    ),
]
ModelOption = Annotated[Path | None, typer.Option("--model", metavar="FILE", help="The model as a model file.")]
HistoryOption = Annotated[
    str, typer.Option("--history", metavar="FILE", help="Temperatures against time; a run of the archive has its own.")
]
JoinOption = Annotated[
    str, typer.Option("--join", metavar="rows|columns", help="Join several files into one recording.")
]
GroupOption = Annotated[
    str, typer.Option("--group", metavar="NAME", help="Group of channels, if the file has several.")
]
ByOption = Annotated[
    str, typer.Option("--by", metavar="NAME", help="Author of the change; the user's name by default.")
]
FreshOption = Annotated[
    str, typer.Option("--fresh", metavar="DWELLS2", help="The same units measured again: never fitted, only predicted.")
]
FreshHistoryOption = Annotated[
    str, typer.Option("--fresh-history", metavar="FILE", help="Temperatures against time of the fresh run.")
]
OtherEffectsOption = Annotated[
    str, typer.Option("--effects", metavar="a,b,c", help="Another model, as a list of effects.")
]
OtherLimitsOption = Annotated[str, typer.Option("--limits", metavar="FILE", help="Other limits: a file or a name.")]
SeriesArgument = Annotated[
    str, typer.Argument(metavar="FILE|RUN", help="A file of samples at rest, or a run of the archive.")
]
SeriesColumnsOption = Annotated[
    str,
    typer.Option(
        "--columns", metavar="x,y,z", help="Columns of the file, or their numbers from 1; all numbers by default."
    ),
]
TimeColumnOption = Annotated[str, typer.Option("--time", metavar="COLUMN", help="Column of the time; or give --rate.")]
TimeUnitOption = Annotated[str, typer.Option("--time-unit", metavar="s|ms|us|ns", help="Unit of the time column.")]
RateOption = Annotated[float | None, typer.Option("--rate", metavar="HZ", min=1e-9, help="Sampling rate.")]
SeriesUnitOption = Annotated[str, typer.Option("--unit", metavar="UNIT", help="Unit of the output, as it is printed.")]
StretchOption = Annotated[
    int | None,
    typer.Option("--stretch", metavar="N", min=1, help="Stretch at rest of an import; the longest by default."),
]
PlotOption = Annotated[Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw it, as PNG, SVG or PDF.")]
PageOption = Annotated[
    Path | None, typer.Option("--page", metavar="FILE.html", help="Write it with its tables, as HTML.")
]
LeaveOutOption = Annotated[
    str, typer.Option("--leave-out", metavar="UNIT:DWELL,…", help="Dwells that are not judged or fitted.")
]
EffectFileOption = Annotated[
    list[Path] | None,
    typer.Option("--effect-file", metavar="FILE.py", help="A Python file with effects of your own; may be repeated."),
]
FormulaOption = Annotated[
    list[str] | None,
    typer.Option(
        "--formula",
        metavar="ID=EXPRESSION",
        help="An effect as a formula over recorded quantities, to be named in --effects; may be repeated.",
    ),
]
SelectionArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="SELECTION…",
        help="Names of runs or their beginnings, 'latest', 'all', device:…, station:…, unit:…, recipe:…, since:DATE, until:DATE.",
    ),
]
DaskOption = Annotated[
    str,
    typer.Option(
        "--dask", metavar="ADDRESS|local", help="Work on Dask workers: of the scheduler at an address, or started here."
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", min=1, help="Processes on this machine; as many as it has cores by default.")
]
