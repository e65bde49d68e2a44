"""The page on identifiability says what is so, and its commands work."""

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipelines.cli import app

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "explanation" / "identifiability.md").read_text(encoding="utf-8")
COMMANDS = [line for block in re.findall(r"```\n(.*?)```", PAGE, re.DOTALL) for line in block.strip().splitlines()]


@pytest.mark.parametrize("line", [c for c in COMMANDS if "optimise" not in c])
def test_commands_of_the_page_work(line, tmp_path, monkeypatch):
    words = shlex.split(line.replace("deploy/", f"{ROOT}/deploy/"))
    monkeypatch.chdir(tmp_path)
    assert words[:2] == ["tumbleline", "plan"]
    assert CliRunner().invoke(app, words[1:]).exit_code == 0


def test_the_command_that_looks_for_a_recipe_has_the_options_of_the_page():
    said = CliRunner().invoke(app, ["plan", "optimise", "--help"], env={"COLUMNS": "200"}).stdout
    (line,) = [c for c in COMMANDS if "optimise" in c]
    for option in [*re.findall(r"--?[a-z]+", line.split("production")[1]), "--wanted", "--factor", "--criterion"]:
        assert option in said


def test_every_picture_of_the_page_is_there_and_small():
    found = re.findall(r"\]\(\.\./pictures/(.*?)\)", PAGE)
    assert len(found) == 4
    for name in found:
        assert (ROOT / "docs" / "pictures" / name).stat().st_size < 150_000


def test_pictures_are_drawn_by_the_command_of_the_page(tmp_path):
    done = CliRunner().invoke(app, ["plan", "production", "--pictures", str(tmp_path), "--json"])
    assert done.exit_code == 0
    drawn = sorted(path.name for path in tmp_path.iterdir())
    assert drawn == [f"production-{name}.svg" for name in ("aliases", "sights", "sphere", "temperature")]
    assert all(path.read_text(encoding="utf-8").startswith("<svg") for path in tmp_path.iterdir())
