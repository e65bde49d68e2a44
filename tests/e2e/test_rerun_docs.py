"""The commands of the guides to re-runs and releases, on a small archive, in the order in which they are printed."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from capture_double import small_run

ROOT = Path(__file__).resolve().parents[2]
GUIDES = ("run-an-archive-again.md", "release-a-model.md")
MODEL = """
[model]
name = "third"
version = 1
effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "third_order"]
"""


def commands(guide: str) -> list[str]:
    text = (ROOT / "docs" / "how-to" / guide).read_text(encoding="utf-8")
    blocks = re.findall(r"```console\n(.*?)```", text, flags=re.DOTALL)
    return [
        line.removeprefix("$ ") for block in blocks for line in block.splitlines() if line.startswith("$ tumbleline")
    ]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("docs")
    small_run(place)
    (place / "model.toml").write_text(MODEL)
    return place


def run(words: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT), "COLUMNS": "200"}
    command = [sys.executable, "-m", "pipelines.cli", *words, "--archive", str(folder / "archive")]
    return subprocess.run(
        command, capture_output=True, text=True, cwd=folder, env=environment, timeout=120, check=False
    )


@pytest.mark.slow
@pytest.mark.parametrize("guide", GUIDES)
def test_the_commands_of_a_guide_do_what_they_say(guide: str, folder: Path) -> None:
    names = {"RUN": "small-", "RE-RUN": "small-"}
    listed = commands(guide)
    assert listed
    for line in listed:
        words = shlex.split(line, comments=True)[1:]
        ids = sorted(path.name for path in (folder / "archive" / "runs").iterdir())
        names |= {"RUN": ids[0], "RE-RUN": ids[-1]}
        done = run([names.get(word, word) for word in words], folder)
        allowed = {"whatif": (0, 1)}.get(words[0], (0, 2) if words[0] == "release" else (0,))
        assert done.returncode in allowed, (line, done.stdout, done.stderr)
        assert "Traceback" not in done.stderr
        if words[0] == "release" and done.returncode == 2:
            assert "says no better" in done.stderr or "says worse" in done.stderr
