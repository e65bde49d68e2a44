"""``tumbleline waveforms``: write the samples of a record of a test procedure in a format of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, RunArgument, option
from pipelines.cli.printing import is_standard_output, print_text, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.export.waveforms import Channel

PART = "Results"
ORDER = 347
SUMMARY = "Write the waveforms of a record for other programs."
EXAMPLES = (
    "tumbleline waveforms latest --record 7 --unit SN1 --format uff58 --output shock.uff",
    "tumbleline waveforms latest --record 0 --unit SN1 --format csv --output first.csv",
)

FORMATS = "csv, hdf5, lvm, mat, tdms, uff58, wav"  # names of the writers, which help does not import


def command(
    run: RunArgument = "latest",
    record: Annotated[int, option("--record N", "Number of the record, from 0.")] = 0,
    unit: Annotated[str, option("--unit SN", "Serial number; default: the first unit of the record.")] = "",
    form: Annotated[str, option("--format", f"{FORMATS}.")] = "csv",
    output: Annotated[
        Path | None, option("--output -o FILE", "File to write; - prints a text; named after run and record.")
    ] = None,
    archive: ArchiveOption = None,
) -> None:
    """Write the channels of a unit and of the reference sensor with unit and sample interval.

    A format that holds only one clock gets one file for each clock: ``…_units`` and ``…_reference``.
    """
    from pipelines.export.waveforms import channels_of, write_waveforms, writer_of

    suffix = writer_of(form).suffix
    stored = Archive(archive).run(run)
    channels = channels_of(stored, record, unit)
    if is_standard_output(output, "waveforms"):
        print_text(_one_text(form, channels, suffix))
        return
    target = output or Path(f"{stored.id[:12]}-record{record}{suffix}")
    for path in write_waveforms(form, channels, target):
        say(f"{path}: {', '.join(one.name for one in channels)}")


def _one_text(form: str, channels: list[Channel], suffix: str) -> str:
    """The file of a format of text; refused for others, and where each clock has a file of its own."""
    from pipelines.export.waveforms import files_of_waveforms

    made = files_of_waveforms(form, channels, Path(f"record{suffix}"))
    try:
        (text,) = (data.decode() for data in made.values())
    except ValueError:
        raise WrongUse(
            f"waveforms: format {form} gives {len(made)} files or no text, one of text is needed for standard output; "
            "name a file with --output"
        ) from None
    return text
