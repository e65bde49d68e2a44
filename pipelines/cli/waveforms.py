"""``tumbleline waveforms``: write the samples of a record of a test procedure in a format of other programs."""

from __future__ import annotations

from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.archive import Run
from pipelines.cli import options
from pipelines.cli.printing import say

if TYPE_CHECKING:
    from pipelines.export.waveforms import Channel

PART = "Results"
ORDER = 347
SUMMARY = "Write the waveforms of a record for other programs."
EXAMPLES = (
    "tumbleline waveforms latest --record 7 --unit SN1 --format uff58 --output shock.uff",
    "tumbleline waveforms latest --record 0 --unit SN1 --format csv --output first.csv",
)

_FOLDER = Path(__file__).parent.parent / "export" / "waveforms"
_NAMES = ", ".join(found.name for found in iter_modules([str(_FOLDER)]) if found.name != "channel")


def command(
    run: options.RunArgument = "latest",
    record: Annotated[int, typer.Option("--record", metavar="N", help="Number of the record, from 0.")] = 0,
    unit: Annotated[
        str, typer.Option("--unit", metavar="SN", help="Serial number; default: the first unit of the record.")
    ] = "",
    form: Annotated[str, typer.Option("--format", help=f"{_NAMES}.")] = "csv",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="File to write; - prints a text; named after run and record.",
        ),
    ] = None,
    archive: options.ArchiveOption = None,
) -> None:
    """Write the channels of a unit and of the reference sensor with unit and sample interval.

    A format that holds only one clock gets one file for each clock: ``…_units`` and ``…_reference``.
    """
    from pipelines.archive import Archive
    from pipelines.cli.standard_output import is_standard_output, print_text
    from pipelines.export.waveforms import WRITERS, write_waveforms
    from schemas.errors import WrongUse, did_you_mean

    if form not in WRITERS:
        raise WrongUse(f"waveforms: no format is called '{form}'; {did_you_mean(form, WRITERS)}")
    stored = Archive(archive).run(run)
    channels = channels_of(stored, record, unit)
    if is_standard_output(output, "waveforms"):
        print_text(_one_text(form, channels))
        return
    place = output or Path(f"{stored.id[:12]}-record{record}{WRITERS[form].SUFFIX}")
    for path in write_waveforms(form, channels, place):
        say(f"{path}: {', '.join(one.name for one in channels)}")


def _one_text(form: str, channels: list[Channel]) -> str:
    """The file of a format of text; refused for others, and where each clock has a file of its own."""
    from tempfile import TemporaryDirectory

    from pipelines.export.waveforms import WRITERS, write_waveforms
    from schemas.errors import WrongUse

    with TemporaryDirectory() as folder:
        paths = write_waveforms(form, channels, Path(folder) / f"record{WRITERS[form].SUFFIX}")
        try:
            (text,) = (path.read_bytes().decode() for path in paths)
        except ValueError:
            raise WrongUse(
                f"waveforms: format {form} gives {len(paths)} files or no text, one of text is needed for standard output; "
                "name a file with --output"
            ) from None
    return text


def channels_of(run: Run, number: int, unit: str) -> list[Channel]:
    """The channels of a unit and of the reference in a record.

    Raises
    ------
    WrongUse
        The run has no samples, or no such record or unit.
    """
    import numpy as np

    from pipelines.export.waveforms import Channel
    from schemas.errors import WrongUse, did_you_mean
    from schemas.units import AXES
    from stations.devices.recording import REFERENCE

    if run.records is None:
        raise WrongUse(f"run {run.id}: no captured samples, they are needed; name the run of a station")
    readings = run.table("readings")
    tables = list(run.records.samples([number])) if number in set(readings["record"]) else []
    if not tables:
        last = int(readings["record"].max())
        raise WrongUse(f"run {run.id}: no record {number}, 0 to {last} are there; choose one of them")
    names = [str(name) for name in readings.loc[readings["record"] == number, "unit"]]
    serial = unit or names[0]
    if serial not in names:
        raise WrongUse(f"run {run.id}: no unit '{serial}'; {did_you_mean(serial, names)}")
    own_unit = str(readings["out_unit"].iloc[0])
    channels: list[Channel] = []
    for name, label, text, group in ((serial, serial, own_unit, "units"), (REFERENCE, "reference", "g", "reference")):
        rows = [table[table["unit"] == name] for table in tables]
        time = np.concatenate([one["time_s"].to_numpy(dtype=float) for one in rows])
        if time.size < 2:
            continue
        interval = float((time[-1] - time[0]) / (time.size - 1))
        for k, axis in enumerate(AXES):
            values = np.concatenate([one[axis].to_numpy(dtype=float) for one in rows])
            channels.append(Channel(f"{label} {axis}", text, group, values, interval, k))
    return same_length(channels)


def same_length(channels: list[Channel]) -> list[Channel]:
    """Channels of one interval cut to the shortest of them, so that they share a clock."""
    from dataclasses import replace

    intervals = {round(one.interval_s, 15) for one in channels}
    if len(intervals) > 1 and max(intervals) - min(intervals) > 1e-9 * max(intervals):
        return channels
    count = min(len(one.values) for one in channels)
    first = channels[0].interval_s
    return [replace(one, values=one.values[:count], interval_s=first) for one in channels]
