"""A page of the reference that is generated: written, or compared with the file by ``--check``."""

from __future__ import annotations

import sys
from pathlib import Path


def write_or_check(page: Path, text: str, module: str) -> int:
    """Write the page, or with ``--check`` compare it; the exit status is 1 if it is out of date.

    Parameters
    ----------
    module : the module that generates the page
    """
    if "--check" in sys.argv[1:]:
        same = page.is_file() and page.read_text(encoding="utf-8") == text
        if not same:
            sys.stdout.write(f"{page.name} is out of date; write it again with 'python -m {module}'\n")
        return 0 if same else 1
    page.write_text(text, encoding="utf-8")
    return 0


def cell(text: str) -> str:
    """Text for a cell of a table, with escaped strokes."""
    return text.replace("|", "\\|")
