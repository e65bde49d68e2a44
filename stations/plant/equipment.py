"""Common parts of the simulated test equipment: what the exciter reaches, errors of SCPI, result files."""

import math
import shutil
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scipy.io import savemat

from schemas.units import STANDARD_GRAVITY_M_S2
from stations.plant.bench import Waveforms

STROKE_M, VELOCITY_M_S, ACCELERATION_G = 0.0127, 1.5, 50.0  # of the exciter
UNKNOWN, WRONG = (
    "NA:CMD ERR",
    "NA:PARA ERR",
)  # answers to a line that is no command, and to a command with a wrong value
DONE = "1"
OUT_OF_RANGE, UNDEFINED = -222, -113  # SCPI-99, 21.8.10 and 21.8.9
TEXTS = {0: "No error", OUT_OF_RANGE: "Data out of range", UNDEFINED: "Undefined header"}


def exciter_reach(frequency: float) -> float:
    """Largest peak acceleration of the exciter at a frequency in Hz, g."""
    w = 2.0 * math.pi * frequency
    return min(STROKE_M * w**2 / STANDARD_GRAVITY_M_S2, VELOCITY_M_S * w / STANDARD_GRAVITY_M_S2, ACCELERATION_G)


def taken(settings: dict[str, float], name: str, value: str) -> tuple[str, bool]:
    """The answer to an order of a number, which is taken over, and whether it changed anything."""
    try:
        settings[name] = float(value)
    except ValueError:
        return WRONG, False
    return "OK", True


class ScpiDevice:
    """A device whose orders are done at once; an error is told when it is asked for, and forgotten."""

    def __init__(self) -> None:
        self.error = 0

    def told_error(self) -> tuple[str, bool]:
        """The answer to the question for errors, and whether it changed anything."""
        code, self.error = self.error, 0
        return f'{code},"{TEXTS[code]}"', code != 0

    def ordered(self, value: str, low: float, high: float, before: float) -> float:
        """The number of an order; the number before, with an error, for what is no number or outside its range."""
        try:
            number = float(value)
        except ValueError:
            self.error = UNDEFINED
            return before
        if low <= number <= high:
            return number
        self.error = OUT_OF_RANGE
        return before


class ResultFiles:
    """Writes each recording to a file; only the last file remains."""

    def __init__(self) -> None:
        self._folder: Path | None = None
        self._last: Path | None = None

    def write(
        self, number: int, recorded: Callable[[], Waveforms], slots: Sequence[int], reference_unit: str = "g"
    ) -> str:
        """The path of the file of a recording, which is computed once."""
        if self._folder is None:
            self._folder = Path(tempfile.mkdtemp(prefix="tumbleline-results-"))
            weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        path = self._folder / f"test{number:06d}.mat"
        if path != self._last:
            content: dict[str, Any] = vars(recorded()) | {"reference_unit": reference_unit}
            outputs = content.pop("outputs")
            savemat(path, content | {f"slot_{slot}": outputs[:, k] for k, slot in enumerate(slots)})
            if self._last is not None:
                self._last.unlink(missing_ok=True)
            self._last = path
        return str(path)
