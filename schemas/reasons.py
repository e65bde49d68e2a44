"""Why a value of a file is refused, in words: a regular expression is none."""

from pydantic_core import ErrorDetails

from schemas.serials import NEEDED, SERIAL_PATTERN

PATTERNS = {
    SERIAL_PATTERN: NEEDED,
    r"^[a-z0-9][a-z0-9._-]*$": "small letters a to z, digits and . _ - are needed, a letter or digit first",
    r"^[a-z][a-z0-9_]*$": "small letters a to z, digits and _ are needed, a letter first",
    r"^([A-Za-z][A-Za-z0-9_]*)?$": "letters A to Z, digits and _ are needed, a letter first",
    r"^([0-9a-f]{64})?$": "64 of the digits 0 to 9 and a to f are needed, as sha256sum prints them",
    r"^([^{}]*\{[^{}]*\}[^{}]*)?$": "a text with one pair of braces is needed, where the value is put",
    r"^(\d{4}-\d\d-\d\d)?$": "a date as 2026-05-17 is needed",
    r"^[^@\s]+@[^@\s]+$": "an address as name@example.org is needed",
    r"^[A-Z]{2}$": "two capitals are needed, the code of the country after ISO 3166",
}
"""What each pattern asks for; a test finds a pattern that is not here."""


def reason_of(detail: ErrorDetails) -> str:
    """The reason of one problem that a model found."""
    needed = PATTERNS.get(detail.get("ctx", {}).get("pattern", ""), "")
    return needed or detail["msg"].removeprefix("Value error, ")
