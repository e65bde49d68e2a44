"""The page on identifiability says what is so, and its commands work."""

import json
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
    lines = [c for c in COMMANDS if "optimise" in c]
    assert len(lines) == 2
    for option in [*re.findall(r"(?<= )--?[a-z]+", " ".join(lines)), "--wanted", "--factor", "--criterion"]:
        assert option in said


@pytest.mark.slow
def test_the_command_of_the_page_that_tells_rivals_apart_finds_what_it_says(tmp_path, monkeypatch):
    (line,) = [c for c in COMMANDS if "--criterion T" in c]
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, [*shlex.split(line)[1:], "--json"])
    assert done.exit_code == 0, done.exception
    document = json.loads(done.stdout)
    assert min(row["chi_square"] for row in document["rivals"]) >= 50.0
    assert max(row["textbook"] for row in document["rivals"]) < 1e-3
    match = re.search(r"(\d+) dwells of 2 s at 25 °C, in (\d+) % of its time, give χ² (\d+)", PAGE)
    assert match is not None
    assert document["dwells"] == pytest.approx(int(match[1]), abs=4)
    assert 100.0 * document["share"] == pytest.approx(int(match[2]), abs=1.0)
    assert min(row["chi_square"] for row in document["rivals"]) == pytest.approx(float(match[3]), rel=0.2)


def test_every_picture_of_the_page_is_there_and_small():
    pictures = re.findall(r"\]\(\.\./pictures/(.*?)\)", PAGE)
    assert len(pictures) == 4
    for name in pictures:
        assert (ROOT / "docs" / "pictures" / name).stat().st_size < 150_000


def test_pictures_are_drawn_by_the_command_of_the_page(tmp_path):
    done = CliRunner().invoke(app, ["plan", "production", "--pictures", str(tmp_path), "--json"])
    assert done.exit_code == 0
    drawn = sorted(path.name for path in tmp_path.iterdir())
    assert drawn == [f"production-{name}.svg" for name in ("aliases", "budget", "sights", "sphere", "temperature")]
    assert all(path.read_text(encoding="utf-8").startswith("<svg") for path in tmp_path.iterdir())
