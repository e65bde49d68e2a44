"""Which unit sits in which slot: a list, a slot map in a file, or a scan, slot by slot."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import WrongUse
from schemas.recipe import parse_toml, read_text

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from schemas.recipe import Lot
    from stations.station import Station

SCAN = "scan"
COLUMNS = ["slot", "serial"]


@dataclass(frozen=True)
class Seating:
    """Serial numbers, and the slot of each where a slot map says; without, they sit slot by slot from 0."""

    units: tuple[str, ...] = ()
    slots: tuple[int, ...] = ()


def read_seating(text: str) -> Seating:
    """The seating in a slot map's file, or in a comma-separated list of serial numbers; empty where the text is."""
    path = Path(text)
    if text and path.suffix.lower() in {".csv", ".toml"}:
        content = read_text(path, "slot map", "CSV or TOML")
        rows = _toml_rows(content, path) if path.suffix.lower() == ".toml" else _csv_rows(content, path)
        return _checked(rows, f"slot map {path.name}")
    return Seating(tuple(serial.strip() for serial in text.split(",")) if text else ())


def scan(slots: int, read: Callable[[int], str], refuse: Callable[[str], None]) -> Seating:
    """The seating as somebody scans it, slot by slot; an empty line leaves a slot empty.

    Parameters
    ----------
    slots : how many there are.
    read : gives the line for a slot.
    refuse : is told what is wrong with a line, before the slot is asked for again.
    """
    found: list[tuple[int, str]] = []
    for slot in range(slots):
        while serial := read(slot).strip():
            twice = [where for where, other in found if other == serial]
            if not twice:
                found.append((slot, serial))
                break
            refuse(
                f"slot {slot}: {serial} was scanned for slot {twice[0]} already; scan the unit that sits in slot {slot}"
            )
    return Seating(tuple(serial for _, serial in found), tuple(slot for slot, _ in found))


def disagreements(station: Station, lot: Lot) -> list[str]:
    """What the slots say against the lot's slot map, one sentence per slot; empty where they agree.

    A slot that does not answer says nothing against it: its unit is refused later, and the others go on.
    """
    from schemas.errors import StationError

    found: list[str] = []
    for unit in lot.units:
        try:
            serial = station.reader.slots[unit.slot].identity().serial
        except StationError:
            continue
        if serial != unit.serial:
            found.append(f"slot {unit.slot}: '{serial}' sits there, '{unit.serial}' is needed")
    return found


def _csv_rows(content: str, path: Path) -> list[tuple[str, str]]:
    rows = list(csv.reader(io.StringIO(content)))
    head = [cell.strip().lower() for cell in rows[0]] if rows else []
    if head[:2] != COLUMNS:
        raise WrongUse(
            f"slot map {path.name}: begins with '{','.join(head)}', a first line 'slot,serial' is needed; add it"
        )
    return [(row[0], row[1]) for row in rows[1:] if len(row) >= 2 and any(cell.strip() for cell in row)]


def _toml_rows(content: str, path: Path) -> list[tuple[str, str]]:
    table = parse_toml(content, f"slot map {path.name}").get("slots")
    if not isinstance(table, dict):
        raise WrongUse(f'slot map {path.name}: no table [slots], one with lines like 0 = "SN1" is needed; add it')
    return [(str(slot), str(serial)) for slot, serial in table.items()]


def _checked(rows: Sequence[tuple[str, str]], source: str) -> Seating:
    slots: list[int] = []
    for number, (slot, serial) in enumerate(rows, start=1):
        if not slot.strip().isdecimal():
            raise WrongUse(
                f"{source}: row {number}: slot '{slot.strip()}', a whole number from 0 on is needed; correct the row"
            )
        if not serial.strip():
            raise WrongUse(
                f"{source}: row {number}: slot {slot.strip()} has no serial number; write it, or leave the row out"
            )
        if int(slot) in slots:
            raise WrongUse(
                f"{source}: row {number}: slot {int(slot)} is there twice, it can hold one unit; correct the map"
            )
        slots.append(int(slot))
    if not slots:
        raise WrongUse(f"{source}: no slot has a unit, at least one is needed; fill it in")
    return Seating(tuple(serial.strip() for _, serial in rows), tuple(slots))
