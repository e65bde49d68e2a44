"""The gateway says that the device behind it does not answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from stations.plant.faults.base import DEVICES, UNIT, Trouble

NO_RESPONSE = 11  # gateway target device failed to respond (Modbus Application Protocol 1.1b3, 7)


@dataclass
class Silent(Trouble):
    """The gateway says that a device does not answer: a plug pulled out, a supply gone."""

    kind: ClassVar[str] = "silent"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def answers(self) -> int:
        """The gateway's exception."""
        return NO_RESPONSE
