"""Result files of the simulated equipment, in a folder of their own that goes with the plant."""

import shutil
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scipy.io import savemat

from stations.plant.bench import Waveforms


class ResultFiles:
    """Writes one file a recording; only the last is kept."""

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
        if path == self._last:
            return str(path)
        made = recorded()
        content: dict[str, Any] = {
            "rate_hz": made.rate_hz,
            "reference": made.reference,
            "reference_rate_hz": made.reference_rate_hz,
            "reference_unit": reference_unit,
            **{f"slot_{slot}": made.outputs[:, k] for k, slot in enumerate(slots)},
        }
        savemat(path, content)
        if self._last is not None:
            self._last.unlink(missing_ok=True)
        self._last = path
        return str(path)
