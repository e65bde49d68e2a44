"""``python -m docs.bring_up_picture``: the picture of a bring-up at a terminal, from a real one at a simulated chamber."""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from rich.console import Console
from rich.text import Text

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "pictures" / "bring-up.svg"
PORT = "5020"
TYPED = ("23.0", "23", "SET", "OFF", "LINK", "simulator")
COLUMNS = 110


def transcript() -> list[tuple[str, str]]:
    """The lines at the terminal, each with what a person types behind it."""
    words = [sys.executable, "-m", "pipelines", "station"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": str(COLUMNS), "NO_COLOR": "1"}
    with tempfile.TemporaryDirectory() as folder:
        environment["TUMBLELINE_STATE"] = folder
        server = subprocess.Popen(  # noqa: S603 - this interpreter
            [*words, "serve", "--port", PORT], stdout=subprocess.PIPE, env=environment, text=True
        )
        try:
            while server.stdout is not None and "Ctrl-C" not in server.stdout.readline():
                pass
            command = ["bring-up", "watlow_f4t", f"tcp://127.0.0.1:{PORT}", "--device-id", "3"]
            quick = ["--set", "silence=3", "--set", "watch=3", "--output", "f4t"]
            own = {"cwd": folder, "env": environment, "capture_output": True, "text": True}
            given = [*words, *command, *quick]
            done = subprocess.run(given, input="\n".join(TYPED) + "\n", check=True, **own)  # noqa: S603 - likewise
        finally:
            server.terminate()
            server.communicate()
    typed = list(TYPED)
    lines = [(f"$ tumbleline station {' '.join(command)}", "")]
    for line in (done.stderr + done.stdout).splitlines():
        asks = re.search(r"(Enter: skip|skip:|not stated)\)?\s*$", line)
        lines.append((line.rstrip(), typed.pop(0) if asks and typed else ""))
    return lines


def main() -> None:
    """Writes the picture."""
    console = Console(record=True, width=COLUMNS, file=io.StringIO())
    for line, typed in transcript():
        text = Text(line)
        if typed:
            text.append(f" {typed}", style="bold green")
        console.print(text)
    svg = console.export_svg(title="tumbleline station bring-up", unique_id="bring-up")
    svg = re.sub(r"@font-face \{.*?\}\s*|<!--.*?-->\s*", "", svg, flags=re.DOTALL)  # fonts of another site
    PICTURE.write_text(svg.replace("Fira Code", "DejaVu Sans Mono"), encoding="utf-8")


if __name__ == "__main__":
    main()
