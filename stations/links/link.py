"""What a device needs of a link; who it is connected to, and by what, is the link's business."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from schemas.profile import Space


class Link(Protocol):
    """Registers and bits of the devices behind one address.

    Reading and writing raise :class:`StationTimeout`, :class:`LinkLost` or :class:`StationRefused`, naming device, address and
    what was asked.
    """

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words, or bits, of ``count`` registers; ``what`` names them in messages."""
        ...

    def write(
        self,
        device_id: int,
        address: int,
        words: Sequence[int],
        what: str,
        space: Space = "holding",
        *,
        since: float | None = None,
    ) -> None:
        """Writes registers or bits in one request, sent once.

        Parameters
        ----------
        since : when the reading came that the order rests on, :func:`stations.clock.steady`; None where it rests on none
        """
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...


class Carrier(Protocol):
    """What is behind the gate: registers and bits on a wire. ``before`` is called as the last thing before a write is sent."""

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words, or bits."""
        ...

    def write(
        self,
        device_id: int,
        address: int,
        words: Sequence[int],
        what: str,
        space: Space = "holding",
        *,
        before: Callable[[], None] | None = None,
    ) -> None:
        """Writes registers or bits in one request, sent once."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...


class TextCarrier(Protocol):
    """What is behind the gate for lines."""

    def ask(self, question: str, what: str) -> str:
        """The answer to a question."""
        ...

    def tell(self, order: str, what: str, *, before: Callable[[], None] | None = None) -> str:
        """The answer to an order, sent once."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...


class TextLink(Protocol):
    """Lines to and from one device; raises as :class:`Link` does."""

    def ask(self, question: str, what: str) -> str:
        """The answer to a question that changes nothing; it may be put twice."""
        ...

    def tell(self, order: str, what: str) -> str:
        """The answer to an order, sent once."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...
