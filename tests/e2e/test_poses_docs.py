"""The guide to choosing poses says what is so, and its commands and pictures are there."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from inertial import frames, poses
from inertial.planning.reasons import reason
from inertial.state import State
from pipelines.cli import COMMANDS, app

DOCS = Path(__file__).resolve().parents[2] / "docs"
GUIDE = (DOCS / "how-to" / "choose-poses.md").read_text(encoding="utf-8")
PLAIN = ("bias", "scale", "misalignment")


def planned(plan: str) -> State:
    outer, inner = np.radians(poses.plan(plan)).T
    time = 12.0 * np.arange(len(outer))
    warm = np.full(len(outer), 25.0)
    return State(frames.force_from_angles(outer, inner), time, warm, warm, outer=outer, inner=inner)


def test_the_sentence_of_the_guide_is_what_is_said():
    quoted = re.search(r"\*(β in 90° steps.*?)\*", GUIDE)
    assert quoted is not None
    assert reason(planned("orthogonal24"), "cross_coupling", PLAIN) == quoted.group(1)


@pytest.mark.parametrize(
    ("plan", "effect", "seen"),
    [
        ("six", "second_order", True), ("six", "cross_coupling", False), ("six", "third_order", False),
        ("twelve", "third_order", False), ("eighteen", "third_order", True), ("eighteen", "cross_coupling", True),
    ],
)  # fmt: skip
def test_the_table_of_what_is_needed_holds(plan, effect, seen):
    assert (reason(planned(plan), effect, PLAIN) == "") == seen


def test_commands_and_options_are_there():
    for line in re.findall(r"^\$ tumbleline (.*)$", GUIDE, re.MULTILINE):
        assert line.split()[0] in COMMANDS
    for command, options in {"investigate": ("--yes", "--ask", "--budget", "--unseen"), "operator": ("--go",)}.items():
        told = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"})
        assert all(option in told.output for option in options), told.output


def test_the_plan_of_the_guide_runs():
    told = CliRunner().invoke(app, ["plan", "production", "--json"])
    assert told.exit_code == 0, told.output


@pytest.mark.slow
def test_pictures_are_as_they_are_drawn(tmp_path):
    script = tmp_path / "docs" / "choose_poses.py"
    script.parent.mkdir()
    script.write_text((DOCS / "pictures" / "choose_poses.py").read_text(encoding="utf-8"), encoding="utf-8")
    subprocess.run([sys.executable, str(script)], check=True, capture_output=True)
    for name in re.findall(r"\.\./pictures/(\S+\.svg)", GUIDE):
        assert (script.parent / name).read_text(encoding="utf-8") == (DOCS / "pictures" / name).read_text(
            encoding="utf-8"
        )
