"""Seating of the units in the slots: a list, a slot map in a file, or a scan, slot by slot."""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from schemas.errors import StationError, WrongUse
from schemas.foreign import foreign, shown
from schemas.lot import Lot
from schemas.serials import refuse_unusable_serials, serial_fault
from schemas.toml_files import parse_toml, read_text
from stations.station import Station

SCAN = "scan"
COLUMNS = ["slot", "serial"]
DIVIDERS = (",", ";", "\t")
"""Separators of the cells of a slot map; Excel writes the second where the comma is the decimal sign."""
LONGEST_SLOT = 4


@dataclass(frozen=True)
class Seating:
    """Serial numbers, and the slot of each from a slot map; without a map the units sit in the slots from 0 on."""

    units: tuple[str, ...] = ()
    slots: tuple[int, ...] = ()


def read_seating(text: str) -> Seating:
    """The seating from a slot map file, or from a comma-separated list of serial numbers; empty for an empty text."""
    path = Path(text)
    if text and path.suffix.lower() in {".csv", ".toml"}:
        content = read_text(path, "slot map", "CSV or TOML")
        rows = _toml_rows(content, path) if path.suffix.lower() == ".toml" else _csv_rows(content, path)
        return _checked(rows, f"slot map {path.name}")
    return Seating(tuple(serial.strip() for serial in text.split(",")) if text else ())


def scan(slots: int, read: Callable[[int], str], refuse: Callable[[str], None]) -> Seating:
    """The seating, scanned at the station slot by slot; an empty line leaves a slot empty.

    slots : number of slots.
    read : returns the line for a slot.
    refuse : called with the fault of a line, before the slot is scanned again.
    """
    entries: list[tuple[int, str]] = []
    for slot in range(slots):
        while serial := read(slot).strip():
            if fault := serial_fault(serial):
                refuse(f"slot {slot}: {fault}; scan it again, or clean the label")
                continue
            twice = [where for where, other in entries if other == serial]
            if not twice:
                entries.append((slot, serial))
                break
            refuse(f"slot {slot}: {serial} was scanned for slot {twice[0]} already; scan the unit in slot {slot}")
    return Seating(tuple(serial for _, serial in entries), tuple(slot for slot, _ in entries))


def disagreements(station: Station, lot: Lot) -> list[str]:
    """Differences between the slots and the lot's slot map, one sentence for each slot; empty where they agree.

    A slot that does not answer is no difference: its unit is refused later, and the others continue.
    """
    entries: list[str] = []
    for unit in lot.units:
        try:
            serial = station.reader.slots[unit.slot].identity().serial
        except StationError:
            continue
        if serial != unit.serial:
            entries.append(f"slot {unit.slot}: '{serial}' sits there, '{unit.serial}' is needed")
    return entries


def _csv_rows(content: str, path: Path) -> list[tuple[str, str]]:
    """Slot and serial number of every line that is not blank; cells are separated as in the first line."""
    where = f"slot map {path.name}"
    lines = content.splitlines()
    first = lines[0] if lines else ""
    divider = next((sign for sign in DIVIDERS if sign in first), DIVIDERS[0])
    with foreign(f"{where}: not a table of text", "save it as CSV again", WrongUse):
        rows = list(csv.reader(io.StringIO(content), delimiter=divider))
    head = [cell.strip().lower() for cell in rows[0]] if rows else []
    if head[:2] != COLUMNS:
        raise WrongUse(f"{where}: begins with '{shown(','.join(head))}', a first line 'slot,serial' is needed; add it")
    entries: list[tuple[str, str]] = []
    for number, row in enumerate(rows[1:], start=1):
        if not any(cell.strip() for cell in row):
            continue
        if not len(COLUMNS) <= len(row) <= len(head):
            raise WrongUse(
                f"{where}: row {number}: {len(row)} cells ({shown(divider.join(row))}), the {len(head)} of the first line are "
                "needed; correct the row"
            )
        entries.append((row[0], row[1]))
    return entries


def _toml_rows(content: str, path: Path) -> list[tuple[str, str]]:
    where = f"slot map {path.name}"
    table = parse_toml(content, where).get("slots")
    if not isinstance(table, dict):
        raise WrongUse(f'{where}: no table [slots], one with lines like 0 = "SN1" is needed; add it')
    for slot, serial in table.items():
        if not isinstance(serial, str):
            entry, written = f"slot {shown(slot)}: found {shown(serial)}", f'"{shown(serial)}"'
            raise WrongUse(f"{where}: {entry}, a serial number in quotes is needed; write {written}")
    return list(table.items())


def _checked(rows: Sequence[tuple[str, str]], source: str) -> Seating:
    slots: list[int] = []
    for number, (slot, serial) in enumerate(rows, start=1):
        text = slot.strip()
        if not (text.isascii() and text.isdecimal() and len(text) <= LONGEST_SLOT):
            raise WrongUse(
                f"{source}: row {number}: slot '{shown(text)}', a whole number from 0 on is needed; correct the row"
            )
        if not serial.strip():
            raise WrongUse(f"{source}: row {number}: slot {text} has no serial number; write it, or leave the row out")
        refuse_unusable_serials([serial.strip()], f"{source}: row {number}: slot {text}", "correct the row", WrongUse)
        if int(slot) in slots:
            raise WrongUse(
                f"{source}: row {number}: slot {int(slot)} is there twice, it can hold one unit; correct the map"
            )
        slots.append(int(slot))
    if not slots:
        raise WrongUse(f"{source}: no slot has a unit, at least one is needed; fill it in")
    serials = tuple(serial.strip() for _, serial in rows)
    twice = next((serial for serial in serials if serials.count(serial) > 1), "")
    if twice:
        raise WrongUse(f"{source}: serial {twice} is there twice, it can sit in one slot; correct the map")
    return Seating(serials, tuple(slots))
