"""The sink of a capture: where records go as they are taken."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import pandas as pd


class CaptureSink(Protocol):
    """Where records go: each is stored whole, or not at all."""

    def finished(self) -> set[int]:
        """Numbers of the records that are stored."""
        ...

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Stores a part of the samples of a long record ahead of the rest; part 0 begins anew."""
        ...

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        """Stores a record durably, with the station's state after it; ``parts`` of its samples are stored already."""
        ...

    def last_state(self) -> bytes | None:
        """The station's state after the record that was stored last."""
        ...
