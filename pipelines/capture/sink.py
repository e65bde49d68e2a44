"""The sink of a capture: it stores each record as soon as it is measured."""

from __future__ import annotations

from typing import Protocol

import pandas as pd


class CaptureSink(Protocol):
    """Storage of records: each is stored completely, or not at all."""

    def finished(self) -> set[int]:
        """Numbers of the records that are stored."""
        ...

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        """Stores a part of the samples of a long record before the record is complete; part 0 discards earlier parts."""
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
        """Stores a record durably, with the station's state after it; ``parts`` parts of its samples are stored already."""
        ...

    def last_state(self) -> bytes | None:
        """The station's state after the last stored record."""
        ...
