"""The boundary to third-party parsers: every error that they raise on foreign bytes becomes one message.

Only the call of the parser is inside :func:`foreign`, never code of this product: a defect of this product must not look like a
broken file. :func:`shown` shortens what a message quotes from a file.
"""

import warnings
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from schemas.errors import DataRejected, TumblelineError

LONGEST_QUOTE = 80
"""Characters of a foreign value that a message shows."""


@contextmanager
def foreign(found: str, remedy: str, error: type[TumblelineError] = DataRejected) -> Generator[None, None, None]:
    """A block with one call of a third-party parser and nothing else.

    Parameters
    ----------
    found : beginning of the message: file, place, and the declared format of the bytes.
    remedy : end of the message: what is needed, and what to do.
    error : class of the refusal.

    Raises
    ------
    DataRejected
        Or ``error``: the parser raised any exception, including lack of memory and recursion depth.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings of parsers are not part of the output of a command
            yield
    except TumblelineError:
        raise
    except Exception as problem:  # noqa: BLE001 - parsers raise any exception on broken bytes; see above
        raise error(f"{found} ({reason(problem)}); {remedy}") from None


def reason(problem: BaseException) -> str:
    """The text of an exception as one short line."""
    if isinstance(problem, RecursionError):
        return "nested too deeply"
    if isinstance(problem, MemoryError):
        return "it needs more memory than is available"
    lines = str(problem).strip().splitlines()
    return shown(lines[0]).strip("'") if lines else type(problem).__name__


def shown(value: object, longest: int = LONGEST_QUOTE) -> str:
    """A foreign value for a message: printable, and not longer than ``longest`` characters."""
    try:
        text = str(value)
    except (ValueError, RecursionError):  # integers of thousands of digits, endless nesting
        return f"a {type(value).__name__} too large to show"
    text = "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
    if len(text) <= longest:
        return text
    head = longest // 2  # the end of a path has the name of the file
    count = f" ({len(text)} characters)" if len(text) > 4 * longest else ""
    return f"{text[:head]}…{text[head - longest :]}{count}"


def is_file(path: str | Path) -> bool:
    """Whether the file exists; false for an impossible name (too long, with a zero byte)."""
    try:
        return Path(path).is_file()
    except (OSError, ValueError):
        return False
