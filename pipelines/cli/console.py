"""A console whose long lines are wrapped between words at a terminal, and left whole in a pipe."""

import os
from typing import Any

from rich.console import Console

from schemas.log_lines import tell, wants_json

COMMAND = "tumbleline "


def limited(out: Console) -> bool:
    """Whether the width is that of a terminal, or stated in COLUMNS; a pipe has none."""
    return out.is_terminal or bool(os.environ.get("COLUMNS"))


class WordConsole(Console):
    """Text for people.

    With ``soft_wrap``, the default of a text here, a line is written as it is, and a terminal breaks it within a word. That holds
    only for lines that are copied: commands, and lines with a word (a path) that is longer than the terminal is wide. What is
    printed on standard error is one object of JSON where messages are (:mod:`schemas.log_lines`).
    """

    def print(self, *objects: Any, soft_wrap: bool | None = None, **options: Any) -> None:
        """Print as :class:`rich.console.Console` does."""
        if len(objects) == 1 and isinstance(objects[0], str) and soft_wrap is not False:
            soft_wrap = not limited(self) or _copied(objects[0], self.width)
        if not (self.stderr and wants_json()):
            super().print(*objects, soft_wrap=soft_wrap, **options)
            return
        with self.capture() as written:
            super().print(*objects, soft_wrap=soft_wrap, **options)
        if text := written.get().strip():
            tell(text, "warning" if text.startswith("warning") else "info")


def _copied(text: str, width: int) -> bool:
    """Whether a line of the text must stay whole: it is a command, or has a word that is longer than the line."""
    lines = text.splitlines() or [""]
    return any(line.lstrip().startswith(COMMAND) or max(map(len, line.split()), default=0) > width for line in lines)
