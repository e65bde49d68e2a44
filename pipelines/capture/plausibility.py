"""Plausibility of a record before it is stored, while it can still be measured again.

Means and outliers come from the one module that decodes samples, which validation and reduction use, too.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from inertial.pointing import TURNED_AWAY, Pointing, contradicts
from pipelines.capture.record import Record
from pipelines.tables.summaries import unit_means
from schemas.errors import OperatorNeeded, StationError
from schemas.event import Event
from schemas.lot import Unit
from stations.devices.reader import Reader
from stations.devices.slot import Identity
from stations.safety.suspenders import Reason, Suspended

TABLE = "table: "
TURNED = f"{TABLE}{TURNED_AWAY}"


@dataclass
class Plausibility:
    """Checks of a record: the slots' identities, outliers among its samples, and the table's angles against all units."""

    reader: Reader
    identities: Mapping[str, Identity]
    pointing: Pointing = field(default_factory=Pointing)

    def unreachable_units(self, units: Sequence[Unit]) -> Iterator[tuple[Unit, StationError]]:
        """Units whose slots no longer answer, with the error.

        Raises
        ------
        OperatorNeeded : another unit sits in a slot than at the start, so its samples have no known unit
        """
        for unit in units:
            try:
                same = self.reader.slots[unit.slot].holds(unit.serial)
            except StationError as problem:
                yield unit, problem
                continue
            if not same:
                raise OperatorNeeded(
                    f"slot {unit.slot}: '{unit.serial}' is no longer there; seat the units as they were, or measure "
                    "the lot anew"
                )

    def refuse_outliers(self, record: Record, units: Sequence[Unit]) -> None:
        """Suspends a record with an implausible sample."""
        outliers: dict[int, str] = {}
        for unit in units:
            identity = self.identities[unit.serial]
            if text := record.outlier(unit.serial, identity.lsb, identity.full_scale):
                outliers[unit.slot] = text
        if outliers:
            slot = min(outliers)
            raise Suspended([Reason("samples", f"slot {slot}: {outliers[slot]}", tuple(outliers))], spoilt=True)

    @staticmethod
    def refuse_contradicted(past: Sequence[Event]) -> None:
        """Refuses to resume a run that ended because all units contradicted the table's encoders."""
        for event in past:
            if event.kind == "stopped" and event.reason.startswith(TURNED):
                raise OperatorNeeded(event.reason)

    def refuse_contradiction(self, soak: int, samples: pd.DataFrame, readings: pd.DataFrame) -> None:
        """Ends the run where all units contradict the encoders of the table.

        Parameters
        ----------
        soak : number of the soak; the table's error is judged over the dwells of one
        samples, readings : the tables of one record
        """
        if samples.empty:  # all of a long record's samples are stored already
            return
        first = readings.iloc[0]
        angles = float(first["outer_deg"]), float(first["inner_deg"])
        text = contradicts(self.pointing.add(soak, angles, unit_means(samples)))
        if text:
            raise OperatorNeeded(f"{TABLE}{text}")
