"""A device answers everything with an exception."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import DEVICES, UNIT, Trouble


@dataclass
class ExceptionCode(Trouble):
    """A device answers everything with one exception: 4 for a failure, 6 for busy, 2 for a register that is not there."""

    kind: ClassVar[str] = "exception_code"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    code: float = 4.0

    def answers(self) -> int:
        """The code."""
        return int(self.code)
