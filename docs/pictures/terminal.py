"""``python docs/pictures/terminal.py``: pictures of the terminal for the operator, from a real run, as SVG by rich."""

from __future__ import annotations

import io
import re
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from rich.console import Console
from rich.text import Text

HERE = Path(__file__).resolve().parent
WIDTH = 80


def picture(text: str, name: str, title: str) -> None:
    """Write a text with its colours as a picture of a terminal."""
    console = Console(record=True, width=WIDTH, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(text))
    svg = re.sub(
        r"@font-face \{.*?\}\s*", "", console.export_svg(title=title, unique_id=name), flags=re.DOTALL
    )  # no network
    (HERE / f"{name}.svg").write_text("\n".join(line.rstrip() for line in svg.splitlines()) + "\n", encoding="utf-8")


def main(result: str, progress: str) -> None:
    """Two pictures from two files: the result as the command printed it, and its progress."""
    picture(Path(progress).read_text("utf-8"), "operator-run", "tumbleline run line-twelve.toml --units SN1,SN2,SN3")
    picture(Path(result).read_text("utf-8"), "operator-result", "tumbleline run line-twelve.toml --units SN1,SN2,SN3")


if __name__ == "__main__":
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        main(*sys.argv[1:])
