"""Serial numbers: one rule for all sources: lots, slot maps, scans, foreign files and options.

A serial number is printed on devices, lists and certificates, is part of file names, and people compare it by eye. It therefore
consists of letters and digits without look-alikes, and has no character with a special meaning in a file system, a spreadsheet or
a shell.
"""

import re
from collections.abc import Iterable

from schemas.errors import DataRejected, TumblelineError
from schemas.foreign import shown

LONGEST_SERIAL = 64
SERIAL_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9._+-]*$"
NEEDED = f"1 to {LONGEST_SERIAL} of the letters A to Z, digits and . _ + - are needed, a letter or digit first"

_SERIAL = re.compile(SERIAL_PATTERN)


def is_serial(text: str) -> bool:
    """Whether a text is a valid serial number."""
    return len(text) <= LONGEST_SERIAL and _SERIAL.fullmatch(text) is not None


def serial_fault(text: str) -> str:
    """The fault of a serial number and what is needed, as part of a message; empty for a valid one."""
    if is_serial(text):
        return ""
    if not text.strip():
        return f"serial {text!r} is blank, {NEEDED}"
    if len(text) > LONGEST_SERIAL:
        return f"serial {shown(text)} is too long, {NEEDED}"
    foreign = next((letter for letter in text if not letter.isascii()), "")
    defect = (
        f" has {foreign!r} (U+{ord(foreign):04X}), which only looks like a plain letter,"
        if foreign.isalnum()
        else " is"
    )
    return f"serial {shown(text)!r}{defect} not usable, {NEEDED}"


def refuse_unusable_serials(
    serials: Iterable[str],
    where: str,
    remedy: str = "correct it, or give another with --units",
    error: type[TumblelineError] = DataRejected,
) -> None:
    """Refuse invalid serial numbers.

    Parameters
    ----------
    where : beginning of the message: file and place.
    remedy : end of the message.
    error : class of the refusal.
    """
    for serial in serials:
        if fault := serial_fault(serial):
            raise error(f"{where}: {fault}; {remedy}")
