"""Serial numbers: one rule for all that comes in, from lots, slot maps, scans, files of others and options.

A serial number is printed on a device, stands in lists and certificates, and becomes part of the names of files; somebody
compares it by eye with another. So it has letters and digits that look like no others, and nothing that a file system, a
spreadsheet or a shell reads as more than a name.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from schemas.errors import DataRejected, TumblelineError
from schemas.foreign import shown

if TYPE_CHECKING:
    from collections.abc import Iterable

LONGEST_SERIAL = 64
SERIAL_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._+-]*$"
NEEDED = f"1 to {LONGEST_SERIAL} of the letters A to Z, digits and . _ + - are needed, a letter or digit first"

_SERIAL = re.compile(SERIAL_PATTERN)


def is_serial(text: str) -> bool:
    """Whether a text can be a serial number."""
    return len(text) <= LONGEST_SERIAL and _SERIAL.fullmatch(text) is not None


def serial_fault(text: str) -> str:
    """What is wrong with a serial number and what is needed, as part of a message; empty where it can be one."""
    if is_serial(text):
        return ""
    if not text.strip():
        return f"serial {text!r} is blank, {NEEDED}"
    if len(text) > LONGEST_SERIAL:
        return f"serial {shown(text)} is too long, {NEEDED}"
    foreign = next((letter for letter in text if not letter.isascii()), "")
    strange = (
        f" has {foreign!r} (U+{ord(foreign):04X}), which only looks like a plain letter,"
        if foreign.isalnum()
        else " is"
    )
    return f"serial {shown(text)!r}{strange} not usable, {NEEDED}"


def refuse_unusable_serials(
    serials: Iterable[str],
    where: str,
    remedy: str = "correct it, or give another with --unit",
    error: type[TumblelineError] = DataRejected,
) -> None:
    """Refuse texts that cannot be serial numbers.

    Parameters
    ----------
    where : beginning of the message: file and place.
    remedy : end of the message.
    error : class of the refusal.
    """
    for serial in serials:
        if fault := serial_fault(serial):
            raise error(f"{where}: {fault}; {remedy}")
