"""Serial numbers that can be printed on a device, in a list and in the name of a file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.errors import DataRejected

if TYPE_CHECKING:
    from collections.abc import Iterable

SEPARATORS = "/\\"


def refuse_unprintable(serials: Iterable[str], where: str) -> None:
    """Refuse serial numbers with line ends, other control characters or separators of paths in them."""
    for serial in serials:
        bad = next((letter for letter in serial if letter in SEPARATORS or not letter.isprintable()), "")
        if bad:
            raise DataRejected(
                f"{where}: serial {serial!r} has {bad!r} in it, letters, digits and signs without separators of paths and line "
                "ends are needed; correct it, or give another with --unit"
            )
