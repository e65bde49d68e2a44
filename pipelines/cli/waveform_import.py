"""Import of the waveforms of a dynamic test, and its printed result."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.cli.options import console, print_json, print_table, short
from schemas.errors import DONE, PART_FAILED, WrongUse

if TYPE_CHECKING:
    from pathlib import Path


def import_and_print(
    paths: list[Path],
    procedure: str,
    part: Path | None,
    unit: str,
    stated: tuple[str, str, float | None, str],
    archive: str | None,
    *,
    as_json: bool,
) -> int:
    """Reduce, keep and print the recordings of one unit; the exit status: part failed where a figure is not determined.

    Parameters
    ----------
    stated : columns and units as the options have them, rate in Hz, group
    """
    from pipelines.importers.mapping import pairs
    from pipelines.importers.waveforms import RecordingLayout, import_waveforms

    if not unit:
        raise WrongUse("import: no serial number, the recordings of a test need one; add --unit SN")
    columns, units, rate, group = stated
    layout = RecordingLayout(pairs(columns, "--map"), pairs(units, "--units"), rate, group)
    imported = import_waveforms(paths, procedure, part, unit, layout, archive)
    if as_json:
        print_json(dict(imported))
    else:
        out = console()
        out.print(f"{imported['unit']}: {imported['records']} recordings, kept as run {imported['run']}", markup=False)
        rows = [
            [one["figure"], one["axis"], short(one["value"]), short(one["uncertainty"]), one["unit"], one["note"]]
            for one in imported["figures"]
        ]
        print_table(["figure", "axis", "value", "standard uncertainty", "unit", "remark"], rows, whole=2)
        for line in imported["text"]:
            out.print(f"  {line}", markup=False, soft_wrap=True)
    return DONE if all(one["identified"] for one in imported["figures"]) else PART_FAILED
