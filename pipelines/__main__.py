"""``python -m pipelines`` and ``tumbleline``: the command line, or one line where a library that it starts with is missing."""

import os
import sys

from schemas.errors import UNUSABLE
from schemas.installed import not_installed
from schemas.log_lines import tell


def main() -> None:
    """Run the command line."""
    _open_standard_streams()
    try:
        from pipelines.cli import main as command_line
    except ImportError as problem:
        told = not_installed(problem)
        if told is None:
            raise
        tell(told, level="error", status=UNUSABLE)
        sys.exit(UNUSABLE)
    command_line()


def _open_standard_streams() -> None:
    """Give a stream that the caller closed to the null device: the next file of the archive would get its descriptor."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is not None:
            continue
        given = os.open(os.devnull, os.O_RDWR)
        if given != number:
            os.dup2(given, number)
            os.close(given)
        setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115 - open until the end


if __name__ == "__main__":
    main()
