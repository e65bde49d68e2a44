"""The boundary to parsers of other makers: whatever they raise on bytes that somebody brought becomes one message.

Only the call of the parser stands inside :func:`foreign`, never code of this product: a defect of ours must not look like a
broken file. What a message quotes from a file is cut by :func:`shown`.
"""

from __future__ import annotations

import warnings
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from schemas.errors import DataRejected, TumblelineError

if TYPE_CHECKING:
    from collections.abc import Generator

LONGEST_QUOTE = 80
"""Characters of a foreign value that a message shows."""


@contextmanager
def foreign(found: str, remedy: str, error: type[TumblelineError] = DataRejected) -> Generator[None, None, None]:
    """A block that holds one call of another maker's parser and nothing else.

    Parameters
    ----------
    found : beginning of the message: file, place, and what the bytes claim to be.
    remedy : end of the message: what is needed, and what to do.
    error : class of the refusal.

    Raises
    ------
    DataRejected
        Or ``error``: the parser raised anything at all, lack of memory and of recursion depth among it.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # remarks of parsers about bytes are no output of a command
            yield
    except TumblelineError:
        raise
    except Exception as problem:  # noqa: BLE001 - parsers raise what they like on broken bytes; see above
        raise error(f"{found} ({reason(problem)}); {remedy}") from None


def reason(problem: BaseException) -> str:
    """What an exception says, as one short line."""
    if isinstance(problem, RecursionError):
        return "nested too deeply"
    if isinstance(problem, MemoryError):
        return "more memory than there is would be needed"
    lines = str(problem).strip().splitlines()
    return shown(lines[0]).strip("'") if lines else type(problem).__name__


def shown(value: object, longest: int = LONGEST_QUOTE) -> str:
    """A foreign value for a message: printable, and never longer than a line, or than so many characters."""
    try:
        text = str(value)
    except (ValueError, RecursionError):  # integers of thousands of digits, endless nesting
        return f"a {type(value).__name__} too large to show"
    text = "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
    if len(text) <= longest:
        return text
    head = longest // 2  # of a path the end tells which file it is
    count = f" ({len(text)} characters)" if len(text) > 4 * longest else ""
    return f"{text[:head]}…{text[head - longest :]}{count}"


def is_file(path: str | Path) -> bool:
    """Whether there is such a file; a name that no system can hold (too long, with a zero byte) is none."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False
