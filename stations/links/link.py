"""What a device needs of a link; who it is connected to is the link's business."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence


class Link(Protocol):
    """Registers of the devices behind one address.

    Reading and writing raise :class:`StationTimeout`, :class:`LinkLost` or :class:`StationRefused`, naming device, address and
    what was asked.
    """

    def read(self, device_id: int, address: int, count: int, what: str) -> list[int]:
        """Words of ``count`` holding registers; ``what`` names them in messages."""
        ...

    def write(self, device_id: int, address: int, words: Sequence[int], what: str) -> None:
        """Writes holding registers in one request, sent once."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...
