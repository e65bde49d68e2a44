"""Recognition of a dynamic recording: time, a reference sensor and a unit, and the test that it is; a proposal for the user."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipelines.importers import values
from pipelines.importers.content import Content, unit_in
from pipelines.importers.documents import ColumnDocument
from pipelines.importers.guesses import Guesses, measurable

_REFERENCE = re.compile(r"(?:^|[^a-z])(?:ref\w*|input|drive|base|shaker|exciter|std)(?:[^a-z]|$)", re.IGNORECASE)
_SLOWEST_HZ = 200.0
"""Least rate of a dynamic recording: slower ones are of a unit at rest or turned by hand."""
_PULSE = 0.2
"""Part of the time beyond a tenth of the largest excursion, below which a motion is a shock: of a sine it is 0.94, of random
vibration 0.6."""


class DynamicGuess(NamedTuple):
    """The command that imports a dynamic recording, the columns of reference and unit, and what the user has to add."""

    command: str
    reference: str
    output: str
    open: list[str]

    def mark(self, columns: Iterable[ColumnDocument]) -> None:
        """Put the meanings of the two columns into the document of an inspection."""
        meanings = {self.reference: ("reference", "its name"), self.output: ("z", "the column beside the reference")}
        for column in columns:
            column["meaning"], column["reason"] = meanings.get(column["name"], (column["meaning"], column["reason"]))


def serial_of(path: Path) -> str:
    """A serial number from the name of a file."""
    stem = re.sub(r"[^A-Za-z0-9._+-]", "-", path.name.split(".")[0]).strip("._+-")
    return stem[:64] or "UNIT-1"


def dynamic_guess(path: Path, content: Content, guessed: Guesses, rate_hz: float | None) -> DynamicGuess | None:
    """What a file with a time and two columns, of which one is named as the reference, may be; None for others."""
    if rate_hz is None or rate_hz < _SLOWEST_HZ:
        return None
    free = [
        name
        for name, one in guessed.columns.items()
        if one.meaning != "time" and content.table[name].dtype.kind in "fi"
    ]
    driven = [name for name in free if _REFERENCE.search(name)]
    if len(free) != 2 or len(driven) != 1:
        return None
    reference = driven[0]
    output = next(name for name in free if name != reference)
    motion = measurable(values.as_numbers(content.table[reference], reference))
    procedure = "shock" if _lasting(motion) < _PULSE else "sweep"
    names = list(guessed.columns)
    pairs = [("time", guessed.column("time")), ("reference", reference), ("z", output)]
    mapped = ",".join(f"{what}={names.index(name) + 1}" for what, name in pairs if name)
    missing = {
        what: f"the unit of column '{name}': --units {what}=…"
        for what, name in (("output", output), ("reference", reference))
        if not (content.units.get(name, "") or unit_in(name))
    }
    stated = [f"{what}=UNIT" for what in missing]
    if guessed.time_unit.meaning and not content.units.get(guessed.column("time"), ""):
        stated.append(f"time={guessed.time_unit.meaning}")
    words = ["tumbleline", "import", str(path), "--procedure", procedure, "--map", mapped]
    words += ["--units", ",".join(stated)] if stated else []
    open_ = list(missing.values())
    if procedure == "shock" and (content.units.get(output, "") or unit_in(output)) in {"V", "mV"}:
        words += ["--part", "SHOCK.toml"]
        open_.append(f"the scale of column '{output}': a file SHOCK.toml with the line scale = … (output per g)")
    words += ["--unit", serial_of(path)]
    return DynamicGuess(shlex.join(words), reference, output, open_)


def _lasting(wave: NDArray[np.float64]) -> float:
    """Part of the samples that are further from the median than a tenth of the furthest."""
    apart = np.abs(wave[np.isfinite(wave)] - np.nanmedian(wave))
    return float(np.mean(apart > 0.1 * apart.max())) if apart.size else 1.0
