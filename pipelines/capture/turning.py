"""Turns of one axis of the table at steady rates, with the readings of its encoder meanwhile."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from pipelines.procedures.recorded import REFERENCE, Turn
from schemas.errors import StationTimeout
from schemas.units import AXES
from stations.clock import Clock
from stations.devices.equipment import REFERENCE_SLOT
from stations.devices.table import GRACE_S, PATIENCE, TiltTable

POLL_S = 0.05  # between readings of the encoder: at 30 °/s every 1.5°, which shows ripple of up to 100 waves a turn
NEAR_DEG = 0.1


@dataclass
class Turning:
    """The turns of one record; ``readings`` are times on the station's clock, s, and angles, degrees."""

    table: TiltTable
    clock: Clock
    turns: Sequence[Turn]
    readings: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])

    def spans(self, longest_s: float) -> Iterator[None]:
        """Stands, turns, stands, and so on; gives way at least every ``longest_s`` s.

        Raises
        ------
        StationTimeout : a turn does not end
        """
        for turn in self.turns:
            yield from self._read(turn, longest_s, self._after(turn.stand_s))
            expected = self.table.turn(turn.axis, turn.to_deg, turn.rate_deg_s)
            late = self._after(PATIENCE * expected + GRACE_S)

            def ended(turn: Turn = turn, late: Callable[[], bool] = late) -> bool:
                if late():
                    text = f"table: {turn.axis} axis not at {turn.to_deg:g} deg in time; check drive and load"
                    raise StationTimeout(text)
                near = abs(self.readings[-1][1] - turn.to_deg) < NEAR_DEG  # only then is the drive asked besides
                return near and self.table.turned(turn.axis, turn.to_deg)

            yield from self._read(turn, longest_s, ended)
        yield from self._read(self.turns[-1], longest_s, self._after(self.turns[-1].stand_s))

    def _after(self, seconds: float) -> Callable[[], bool]:
        end = self.clock.now() + seconds
        return lambda: self.clock.now() >= end

    def _read(self, turn: Turn, longest_s: float, ended: Callable[[], bool]) -> Iterator[None]:
        axis, way = self.table.axes[turn.axis], self._after(longest_s)
        while not ended():
            asked = self.clock.now()
            angle = axis.position()
            self.readings.append((0.5 * (asked + self.clock.now()), angle))
            if way():
                yield
                way = self._after(longest_s)
            self.clock.sleep(POLL_S)
        yield

    def frame(self, record: int) -> pd.DataFrame:
        """The readings as samples under a name that no serial can have: the angle in the first column."""
        n = len(self.readings)
        time, angle = np.array(self.readings).T
        nothing = dict.fromkeys(AXES[1:], np.full(n, np.nan))
        return pd.DataFrame(
            {
                "unit": pd.Series([REFERENCE] * n, dtype="str"),
                "slot": np.full(n, REFERENCE_SLOT, dtype=np.int64),
                "record": np.full(n, record, dtype=np.int64),
                "kind": pd.Series(["procedure"] * n, dtype="str"),
                "time_s": time,
                AXES[0]: angle,
                **nothing,
            }
        )
