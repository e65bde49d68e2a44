"""Errors of the product, sorted by who must act.

A message reads ``where: what was found (value, unit), what is needed; what to do``. A unit that fails its limits is a
result, not an exception; anything that is not one of these classes is a defect of the program.
"""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from collections.abc import Iterable

DONE = 0
PART_FAILED = 1
UNUSABLE = 2
STATION = 3
UNEXPECTED = 70
"""A defect of the program (EX_SOFTWARE of sysexits.h); never 1, which scripts read as a verdict."""


class TumblelineError(Exception):
    """What a person can do something about; the command line prints it as one message and leaves with its status."""

    exit_status: ClassVar[int] = UNUSABLE


class WrongUse(TumblelineError):
    """A command or function called in a way that cannot work: the caller changes the call."""


class RecipeInvalid(TumblelineError):
    """A recipe, limits, station, profile or model file that cannot be used: its author changes the named key.

    Parameters
    ----------
    message : what was found and what is needed.
    key : dotted path of the offending key, empty when the whole file is meant.
    close : keys or values that exist and look like what was found.
    """

    def __init__(self, message: str, *, key: str = "", close: Iterable[str] = ()) -> None:
        self.key = key
        self.close = tuple(close)
        super().__init__(message)


class DataRejected(TumblelineError):
    """Data that cannot be used: they are measured or delivered again."""


class ArchiveUnusable(TumblelineError):
    """A folder or file of the archive that cannot be written, read or trusted."""


class StationError(TumblelineError):
    """The station did not do what it was asked."""

    exit_status: ClassVar[int] = STATION


class StationTimeout(StationError):
    """A device that did not answer, or did not reach its target, in time; the attempt may be repeated."""


class NotReached(StationTimeout):
    """A target that was not reached in its time, though the device answers: asking again at once gains nothing."""


class LinkLost(StationError):
    """A connection that broke; the attempt may be repeated once it is there again."""


class OperatorNeeded(StationError):
    """Something that only a person at the station can put right (door, interlock, power, a missing unit)."""


class LeaseLost(TumblelineError):
    """A run that may drive its station no longer: it stood still, or another drives. It sends nothing more and ends.

    Not one of the station's errors, so that nothing that tries again after those, or works round them, goes on after it.
    """

    exit_status: ClassVar[int] = STATION


class StationRefused(StationError):
    """A command outside what a device is able or allowed to do; nothing was moved."""


def close_matches(found: str, known: Iterable[str]) -> tuple[str, ...]:
    """Up to three of the known names that look like the one found, best first."""
    by_lower: dict[str, list[str]] = {}
    for name in sorted(set(known)):
        by_lower.setdefault(name.lower(), []).append(name)
    near = get_close_matches(found.lower(), list(by_lower), n=3, cutoff=0.55)
    return tuple(name for lower in near for name in by_lower[lower])[:3]


def did_you_mean(found: str, known: Iterable[str]) -> str:
    """A clause to end a message with: the close matches, or all that is known where there are none."""
    names = sorted(set(known))
    close = close_matches(found, names)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"known: {', '.join(names)}"
