"""The export formats: each module of this package is a format of its name, and is discovered here."""

import re
from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules
from typing import Protocol, cast

from pipelines.export.polynomials import UnitCalibration, refuse_fewer_axes
from pipelines.export.settings import ExportSettings
from schemas.errors import WrongUse


class Format(Protocol):
    """A module that writes calibrations in one format.

    SUFFIX : of the file's name, several where it makes several files for a unit and names them; ONE_UNIT where a file holds one
    unit; COMPLETE where it names effects that have no polynomial; FEWER_AXES where it holds devices with one axis or two
    """

    SUFFIX: str | tuple[str, ...]

    def write(
        self, units: Sequence[UnitCalibration], run: str, settings: ExportSettings
    ) -> str | bytes | dict[str, bytes]:
        """The calibrations as the content of a file, or of several by name."""
        ...


FORMATS: dict[str, Format] = {
    info.name: cast("Format", import_module(f"{__name__}.{info.name}")) for info in iter_modules(__path__)
}


def export_files(
    name: str, units: Sequence[UnitCalibration], run: str, settings: ExportSettings | None = None
) -> dict[str, bytes]:
    """Files by name with the calibrations in one of :data:`FORMATS`: one for each unit where the format holds one only.

    Raises
    ------
    WrongUse
        The model has an effect that the format cannot hold, or the format needs a setting that is missing.
    """
    form, chosen = FORMATS[name], settings or ExportSettings()
    if (left := units[0].left_out) and not getattr(form, "COMPLETE", False):
        raise WrongUse(
            f"export: effect {', '.join(left)} has no place in format {name}, which knows bias, scale, misalignment and "
            "their temperature; export json, or fit a model without it"
        )
    if not getattr(form, "FEWER_AXES", False):
        refuse_fewer_axes(units, f"export: format {name}")
    groups = [[unit] for unit in units] if getattr(form, "ONE_UNIT", False) else [list(units)]
    files: dict[str, bytes] = {}
    for group in groups:
        content = form.write(group, run, chosen)
        stem = group[0].unit if len(groups) > 1 else "calibration"
        made = content if isinstance(content, dict) else {f"{stem}{form.SUFFIX}": content}
        for asked, data in made.items():
            name_of_file = re.sub(r"[^\w.-]", "_", asked)
            if name_of_file in files:
                raise WrongUse(
                    f"export: two units have the file name {name_of_file}, one each is needed; export them one by one with "
                    "--units"
                )
            files[name_of_file] = data if isinstance(data, bytes) else data.encode()
    return files
