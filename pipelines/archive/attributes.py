"""Attributes of units and runs beside the measurement: wafer, supplier, batch, firmware, operator, date of assembly.

One file for each time that something was added; a changed value is a new row, and the newest one counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipelines.archive import files
from pipelines.archive.archive import Archive

FOLDER = "attributes"


@dataclass(frozen=True)
class Attributes:
    """The newest values: by serial and by run, name → value as text."""

    serial: Mapping[str, Mapping[str, str]]
    run: Mapping[str, Mapping[str, str]]

    def names(self) -> list[str]:
        """Names of all attributes, in order of appearance."""
        every = (name for known in (self.serial, self.run) for values in known.values() for name in values)
        return list(dict.fromkeys(every))

    def values(self, name: str) -> list[str]:
        """All known values of an attribute, of units and of runs."""
        return [values[name] for known in (self.serial, self.run) for values in known.values() if name in values]

    def of(self, serial: str, run: str, name: str) -> str:
        """The value of a unit in a run: its own, or that of the run; empty where neither is known."""
        of_unit = self.serial.get(serial, {}).get(name, "")
        return of_unit or self.run.get(run, {}).get(name, "")


def known_attributes(archive: Archive, until: str = "") -> Attributes:
    """The attributes of an archive; with a time in UTC, only what was known then, to the second."""
    known: dict[str, dict[str, dict[str, str]]] = {"serial": {}, "run": {}}
    for path in attribute_files(archive):
        content = files.read_json(path)
        if until and content["when"][:19] > until[:19]:
            continue
        for key, values in content.get("values", {}).items():
            known[content["by"]].setdefault(key, {}).update({name: str(value) for name, value in values.items()})
    return Attributes(known["serial"], known["run"])


def attribute_files(archive: Archive) -> list[Any]:
    """The files of attributes, in order."""
    folder = archive.root / FOLDER
    if not folder.is_dir():
        return []
    return sorted((path for path in folder.iterdir() if path.name.endswith(".json")), key=lambda path: path.name)
