"""Errors of the product, sorted by who must act.

A message reads ``where: what was found (value, unit), what is needed; what to do``. A unit that fails its limits is a
result, not an exception; anything that is not one of these classes is a defect of the program.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from typing import ClassVar

DONE = 0
PART_FAILED = 1
UNUSABLE = 2
STATION = 3
UNEXPECTED = 70
"""A defect of the program (EX_SOFTWARE of sysexits.h); never 1, which scripts read as a result."""


class TumblelineError(Exception):
    """An error that a person can correct; the command line prints it as one message and exits with its status."""

    exit_status: ClassVar[int] = UNUSABLE


class WrongUse(TumblelineError):
    """A command or function with unusable arguments: the caller corrects the call."""


class RecipeInvalid(TumblelineError):
    """An unusable recipe, limits, station, profile or model file: its author corrects the named key.

    Parameters
    ----------
    message : what was found and what is needed.
    key : dotted path of the offending key, empty for the whole file.
    close : existing keys or values that are similar to the given one.
    """

    def __init__(self, message: str, *, key: str = "", close: Iterable[str] = ()) -> None:
        self.key = key
        self.close = tuple(close)
        super().__init__(message)


class DataRejected(TumblelineError):
    """Unusable data: they must be measured or delivered again."""


class ArchiveUnusable(TumblelineError):
    """A folder or file of the archive that cannot be written, read or trusted."""


class StationError(TumblelineError):
    """The station did not carry out a command."""

    exit_status: ClassVar[int] = STATION


class StationTimeout(StationError):
    """A device that did not answer, or did not reach its target, in time; the attempt may be repeated."""


class NotReached(StationTimeout):
    """A target that was not reached in time, though the device answers: an immediate repetition has no use."""


class LinkLost(StationError):
    """A lost connection; the attempt may be repeated on a new connection."""


class NoConnection(LinkLost):
    """A connection that could not be made: nothing listens at the address, or there is no such line."""


class OperatorNeeded(StationError):
    """A condition that only a person at the station can correct (door, interlock, power, a missing unit)."""

    @property
    def condition(self) -> str:
        """The condition to correct, for a person who is asked at the station, without the command."""
        return str(self)


class LeaseLost(TumblelineError):
    """A run that has lost the lease of its station: it stopped responding, or another run drives. It sends nothing more and ends.

    Not a :class:`StationError`, so that no code that repeats or continues after those errors does so after this one.
    """

    exit_status: ClassVar[int] = STATION


class StationRefused(StationError):
    """A command outside what a device is able or allowed to do; nothing was moved."""


def close_matches(given: str, known: Iterable[str]) -> tuple[str, ...]:
    """Up to three known names that are similar to the given one, best first."""
    by_lower: dict[str, list[str]] = {}
    for name in sorted(set(known)):
        by_lower.setdefault(name.lower(), []).append(name)
    near = get_close_matches(given.lower(), list(by_lower), n=3, cutoff=0.55)
    return tuple(name for lower in near for name in by_lower[lower])[:3]


def did_you_mean(given: str, known: Iterable[str]) -> str:
    """The end of a message: the similar names, or all known names where none is similar."""
    names = sorted(set(known))
    close = close_matches(given, names)
    if close:
        return f"did you mean {' or '.join(close)}?"
    return f"known: {', '.join(names) or 'none'}"
