"""``tumbleline export --waveforms``: the samples of a record of a test procedure in a format of other programs."""

from pathlib import Path
from typing import TYPE_CHECKING

from pipelines.cli.printing import is_standard_output, print_text, say
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.archive import Run
    from pipelines.export.waveforms import Channel


def write_record(run: "Run", record: int, unit: str, form: str, output: Path | None) -> None:
    """Write the channels of a unit and of the reference in a record of a run; print the files.

    unit : serial number; empty for the first unit of the record
    Raises WrongUse: no such record, unit or format.
    """
    from pipelines.export.waveforms import channels_of, write_waveforms, writer_of

    suffix = writer_of(form).suffix
    channels = channels_of(run, record, unit)
    if is_standard_output(output, "export"):
        print_text(_one_text(form, channels, suffix))
        return
    target = output or Path(f"{run.id[:12]}-record{record}{suffix}")
    names = ", ".join(channel.name for channel in channels)
    for path in write_waveforms(form, channels, target):
        say(f"{path}: {names}")


def _one_text(form: str, channels: "list[Channel]", suffix: str) -> str:
    """The file of a format of text; refused for others, and where each clock has a file of its own."""
    from pipelines.export.waveforms import files_of_waveforms

    made = files_of_waveforms(form, channels, Path(f"record{suffix}"))
    try:
        (text,) = (data.decode() for data in made.values())
    except ValueError:
        raise WrongUse(
            f"export: format {form} gives {len(made)} files or no text, one of text is needed for standard output; "
            "name a file with --output"
        ) from None
    return text
