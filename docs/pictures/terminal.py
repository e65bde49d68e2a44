"""Pictures of the terminal for the operator, as SVG by rich, from a lot that is measured in a folder that is removed.

    PYTHONPATH=. .venv/bin/python docs/pictures/terminal.py

replaces both pictures: the result as the command prints it, and its progress at one dwell.
"""

from __future__ import annotations

import fcntl
import io
import os
import pty
import re
import struct
import subprocess
import sys
import tempfile
import termios
from pathlib import Path

from rich.console import Console
from rich.text import Text

HERE = Path(__file__).resolve().parent
RECIPE = HERE.parents[1] / "deploy" / "recipes" / "line-twelve.toml"
WORDS = ("run", RECIPE.name, "--units", "SN1,SN2,SN3")
WIDTH, AT = 80, "25 °C, dwell p06"


def picture(text: str, name: str, title: str) -> None:
    """Write a text with its colours as a picture of a terminal."""
    console = Console(record=True, width=WIDTH, file=io.StringIO(), force_terminal=True)
    console.print(Text.from_ansi(text))
    svg = re.sub(
        r"@font-face \{.*?\}\s*", "", console.export_svg(title=title, unique_id=name), flags=re.DOTALL
    )  # no network
    (HERE / f"{name}.svg").write_text("\n".join(line.rstrip() for line in svg.splitlines()) + "\n", encoding="utf-8")


def measured(folder: Path) -> tuple[str, str]:
    """What the command prints as result, and what it writes to the terminal while it measures."""
    for path in RECIPE.parent.glob("line-*.toml"):
        (folder / path.name).write_bytes(path.read_bytes())
    own, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 40, WIDTH, 0, 0))
    size = {"COLUMNS": str(WIDTH), "FORCE_COLOR": "1", "TERM": "xterm-256color"}
    words = [sys.executable, "-m", "pipelines.cli", *WORDS, "--yes", "--direct"]
    with subprocess.Popen(words, cwd=folder, env=os.environ | size, stdout=subprocess.PIPE, stderr=its) as command:  # noqa: S603 - our own interpreter and module
        os.close(its)
        parts: list[bytes] = []
        try:
            while part := os.read(own, 65536):
                parts.append(part)
        except OSError:  # the command has closed its terminal
            pass
        out = command.stdout.read() if command.stdout else b""
    assert command.returncode == 0, out
    return out.decode(), b"".join(parts).decode()


def main() -> None:
    """Write both pictures."""
    with tempfile.TemporaryDirectory() as place:
        result, progress = measured(Path(place))
    frames = re.split(r"\r(?:\x1b\[2K|\x1b\[1A)*", progress.replace("\r\n", "\n"))
    title = " ".join(("tumbleline", *WORDS))
    picture(next(frame for frame in frames if AT in frame).strip(), "operator-run", title)
    picture(result.strip("\n"), "operator-result", title)


if __name__ == "__main__":
    main()
