"""The tab key in a real bash: commands, runs, units, effects, recipes and options."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.release import unpack
from pipelines.cli import COMMANDS, _OnDemand
from pipelines.cli.candidates import SOURCES, candidates_of

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "tests" / "archives" / "v1.tar.xz"
TAB = """
source "$1"
COMP_WORDS=("${@:2}")
COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
_tumbleline_completion tumbleline
printf '%s\\n' "${COMPREPLY[@]}"
"""
pytestmark = pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home in which the completion is installed, and a working folder with an archive and a recipe."""
    folder = tmp_path_factory.mktemp("home")
    unpack(KEPT, folder / "archive")
    (folder / "recipes").mkdir()
    (folder / "recipes" / "my.toml").write_text("", encoding="utf-8")
    done = bash("tumbleline --install-completion; true", folder)
    assert "bash completion installed" in done.stdout, done.stderr
    assert ".bash_completions/tumbleline.sh" in (folder / ".bashrc").read_text(encoding="utf-8")
    return folder


def bash(script: str, home: Path, *words: str) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {"HOME": str(home), "PATH": path, "XDG_CONFIG_HOME": str(home / "config"), "LANG": "C.UTF-8"}
    return subprocess.run(
        ["bash", "--norc", "-c", script, "bash", *words],
        cwd=home, env=environment, capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["dia"], {"diagnose"}),
        (["run", "m"], {"my"}),
        (["report", "la"], {"latest"}),
        (["show", "A"], {"A1", "A2"}),
        (["extend", "model.toml", "third"], {"third_order"}),
        (["diagnose", "latest", "--effects", "bias,sca"], {"bias,scale", "bias,scale_temperature"}),
        (["plan", "opt"], {"optimise"}),
        (["run", "--fau"], {"--fault"}),
        (["correct", "flight.csv", "--calibration", "la"], {"latest"}),
        (["plan", "optimise", "production", "--wanted", "third"], {"third_order="}),
    ],
)
def test_the_tab_key_offers(place: Path, words: list[str], offered: set[str]) -> None:
    done = bash(TAB, place, str(place / ".bash_completions" / "tumbleline.sh"), "tumbleline", *words)
    assert done.stderr == ""
    assert offered <= set(done.stdout.split())


def test_nothing_is_offered_and_nothing_printed_where_a_word_is_wrong(place: Path) -> None:
    script = place / ".bash_completions" / "tumbleline.sh"
    done = bash(TAB, place, str(script), "tumbleline", "nonsense", "")
    assert (done.stdout.strip(), done.stderr) == ("", "")


def leaves(command: object) -> list[object]:
    below = getattr(command, "commands", {})
    return [leaf for one in below.values() for leaf in leaves(one)] if below else [command]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_parameter_that_takes_a_name_has_candidates(name: str) -> None:
    for leaf in leaves(_OnDemand(name)._load()):
        for parameter in leaf.params:
            metavar = str(getattr(parameter, "metavar", "") or "").replace("FLOW-RUN", "")
            if any(word in metavar for word in ("RUN", "RECIPE", "PROFILE", "PRESET", "EFFECT", "SERIAL", "SELECTION")):
                assert candidates_of(parameter) is not None, (name, parameter.name, metavar)


def test_every_source_belongs_to_a_parameter() -> None:
    parameters = {
        (parameter.name, part)
        for name in COMMANDS
        for leaf in leaves(_OnDemand(name)._load())
        for parameter in leaf.params
        for _, part in SOURCES
        if part in str(getattr(parameter, "metavar", "") or "")
    }
    assert [key for key in SOURCES if key not in parameters] == []
