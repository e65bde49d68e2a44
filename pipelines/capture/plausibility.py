"""Whether what a capture has just taken can be what the units did: before it is stored, while it can still be measured again."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from inertial.pointing import TURNED_AWAY, Pointing, contradicts
from schemas.errors import OperatorNeeded, StationError
from stations.safety.suspenders import Reason, Suspended

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pipelines.capture.record import Record
    from schemas.event import Event
    from schemas.recipe import Unit
    from stations.devices.reader import Reader
    from stations.devices.slot import Identity


TABLE = "table: "
TURNED = f"{TABLE}{TURNED_AWAY}"


@dataclass
class Soundness:
    """Judges records by the slots' identities, by their own samples, and by what the lot says of the table."""

    reader: Reader
    identities: Mapping[str, Identity]
    pointing: Pointing = field(default_factory=Pointing)

    def others(self, units: Sequence[Unit]) -> Iterator[tuple[Unit, StationError]]:
        """Units whose slots do not answer any more, with the problem.

        Another unit than when the run began ends it: nobody knows whose samples these are.
        """
        for unit in units:
            try:
                same = self.reader.slots[unit.slot].holds(unit.serial)
            except StationError as problem:
                yield unit, problem
                continue
            if not same:
                raise OperatorNeeded(
                    f"slot {unit.slot}: '{unit.serial}' does not sit there any more; seat the units as they were, or measure "
                    "the lot anew"
                )

    def refuse_strays(self, record: Record, units: Sequence[Unit]) -> None:
        """Suspends a record with a sample that cannot be the unit's."""
        found: dict[int, str] = {}
        for unit in units:
            identity = self.identities[unit.serial]
            text = record.stray(unit.serial, identity.lsb, identity.full_scale)
            if text:
                found[unit.slot] = text
        if found:
            slot = min(found)
            raise Suspended([Reason("samples", f"slot {slot}: {found[slot]}", tuple(found))], spoilt=True)

    @staticmethod
    def refuse_contradicted(past: Sequence[Event]) -> None:
        """Refuses to go on behind dwells that were stored before all units contradicted the table's encoders."""
        for event in past:
            if event.kind == "stopped" and event.reason.startswith(TURNED):
                raise OperatorNeeded(event.reason)

    def refuse_contradiction(self, record: Record, units: Sequence[Unit]) -> None:
        """Ends the run where all units say that the table does not stand where its encoders say."""
        if not units:
            return
        seen = record.seen(units[0].slot)
        text = contradicts(self.pointing.add(record.soak, (seen["outer_deg"], seen["inner_deg"]), record.means(units)))
        if text:
            raise OperatorNeeded(f"{TABLE}{text}")
