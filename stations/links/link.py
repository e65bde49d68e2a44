"""Interface between devices and links; address and protocol belong to the link."""

from collections.abc import Callable, Sequence
from typing import Protocol

from schemas.profile import Space


class Link(Protocol):
    """Registers and bits of the devices behind one address.

    Reading and writing raise :class:`StationTimeout`, :class:`LinkLost` or :class:`StationRefused`, with device, address and
    request.
    """

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words, or bits, of ``count`` registers; ``what`` is their name in messages."""
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
        since : time of the reading that the command depends on, :func:`stations.clock.steady`; None without one
        """
        ...


class Carrier(Protocol):
    """The link behind the gate: registers and bits on a wire. ``before`` is the last call before a write is sent."""

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


class TextLink(Protocol):
    """Text lines to and from one device; the errors are those of :class:`Link`."""

    def ask(self, question: str, what: str) -> str:
        """The answer to a query without side effects; the query may be repeated."""
        ...

    def tell(self, order: str, what: str) -> str:
        """The answer to a command, sent once."""
        ...


class TextCarrier(TextLink, Protocol):
    """The text link behind the gate."""

    def tell(self, order: str, what: str, *, before: Callable[[], None] | None = None) -> str:
        """The answer to a command, sent once; ``before`` is the last call before it is sent."""
        ...

    def close(self) -> None:
        """Ends the connection."""
        ...
