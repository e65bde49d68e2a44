"""The guides of the station's safety say what is so."""

import re
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipelines.cli import app
from schemas.safety import Safety, SelfTest, Suspenders
from stations.self_test import NOISIER, SIGMAS

DOCS = Path(__file__).resolve().parents[2] / "docs"
SAFETY = (DOCS / "explanation" / "station-safety.md").read_text(encoding="utf-8")
CHECK = (DOCS / "how-to" / "daily-station-check.md").read_text(encoding="utf-8")
SECTIONS = {"suspenders": Suspenders, "safety": Safety, "self_test": SelfTest}


def sections(text: str) -> dict:
    merged: dict = {}
    for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL):
        merged |= tomllib.loads(block)
    return merged


def test_the_figures_that_hold_by_default_are_those_of_the_text():
    told = sections(SAFETY)
    for name in ("suspenders", "safety"):
        assert SECTIONS[name].model_validate(told[name]) == SECTIONS[name]()
        unsaid = set(SECTIONS[name].model_fields) - set(told[name])
        assert all(re.search(rf"# {key} = ", SAFETY) for key in unsaid), unsaid


def test_the_self_test_of_the_guide_is_one():
    told = SelfTest.model_validate(sections(CHECK)["self_test"])
    assert told.standard == "CS-01"
    assert told.model_copy(update={"standard": ""}) == SelfTest()
    assert f"`history_min` = {told.history_min}" in CHECK
    assert (NOISIER, SIGMAS) == (3.0, 3.0)


@pytest.mark.parametrize("text", [SAFETY, CHECK], ids=["safety", "check"])
def test_commands_of_the_guides_are_there_with_their_options(text):
    commands = re.findall(r"^\$ tumbleline (.+?)(?:\s+#.*)?$", text, re.MULTILINE)
    assert commands
    for command in commands:
        words = command.split()
        name = words[:2] if words[0] == "station" else words[:1]
        helped = CliRunner().invoke(app, [*name, "--help"], env={"COLUMNS": "200"})
        assert helped.exit_code == 0, command
        assert all(word in helped.stdout for word in words if word.startswith("--")), command
