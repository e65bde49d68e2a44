"""``python -m pipelines`` and ``tumbleline``: the command line, or one line where a library that it starts with is missing."""

from __future__ import annotations

import sys

from schemas.errors import UNUSABLE
from schemas.installed import not_installed
from schemas.log_lines import tell


def main() -> None:
    """Run the command line."""
    try:
        from pipelines.cli import main as command_line
    except ImportError as problem:
        told = not_installed(problem)
        if told is None:
            raise
        tell(told, level="error", status=UNUSABLE)
        sys.exit(UNUSABLE)
    command_line()


if __name__ == "__main__":
    main()
