"""What every command prints is the approved text, in eighty columns; what is copied (commands, paths, serials) stays whole."""

import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from approved import difference, normalised
from capture_double import finished_run
from in_process import given
from root_process import ROOT
from test_next_lines import MODEL

from pipelines.archive import Archive
from pipelines.cli import COMMANDS

WIDE = 80
OUTPUTS = {
    "list": ["list"],
    "show": ["show", "latest", "coefficients"],
    "show-report": ["show", "latest", "--report"],
    "lineage": ["lineage", "latest"],
    "verify": ["verify"],
    "certificate-issue": ["certificate", "issue", "latest", "--units", "A1"],
    "certificate-revoke": ["certificate", "revoke", "A1", "--reason", "fell to the floor"],
    "export": ["export", "latest", "--format", "csv"],
    "audit": ["audit"],
    "archive-query": ["archive", "query", "select unit, figure, value from figures limit 5"],
    "rerun": ["rerun", "all", "--check"],
    "fit": ["fit", "latest", "--limits", "industrial"],
    "archive-diff": ["archive", "diff", "latest", "latest"],
    "release": ["release"],
    "compare": ["compare", "latest"],
    "diagnose": ["diagnose", "latest", "--effects", "bias,scale,misalignment"],
    "history": ["history", "m.toml"],
    "extend": ["extend", "n.toml", "third_order"],
    "plan-choose": ["plan", "choose", "range=4g", "temperature=-40..85", "error=2mg", "bandwidth=100"],
    "plan": ["plan", "small.toml"],
    "plan-line": ["plan", "line", "line.toml"],
    "run": ["run", "small.toml", "--direct"],
    "station": ["station", "log"],
    "plan-keys": ["plan", "keys", "recipe"],
    "inspect": ["inspect", "rest.csv"],
    "import": ["import", "rest.csv", "--map", "time=t,x=x,y=y,z=z", "--unit-of", "output=g", "--units", "R1"],
    "noise-allan": ["noise", "allan", "rest.csv", "--rate", "100", "--map", "x,y,z"],
    "noise-psd": ["noise", "psd", "rest.csv", "--rate", "100", "--map", "x,y,z"],
    "station-monitor": ["station", "monitor"],
    "archive": ["archive", "clean", "--dry-run"],
    "attributes": ["attributes", "list"],
    "discover": ["discover", "--reach"],
}
"""The main output of each command, in a folder with one run; a subcommand follows with a hyphen."""

UNSTEADY = {
    "audit": "its periods are those up to today",
    "station-monitor": "tells of now",
    "station": "tells what the machine has noted",
    "lineage": "names the machine and its libraries",
    "plan-keys": "its text is that of docs/reference",
}
"""Commands whose text is not compared, each with its reason."""

BEFORE = {"certificate-revoke": OUTPUTS["certificate-issue"]}
"""What is given before a command whose output needs it."""

ELSEWHERE = {
    "demo": "measures for half a minute; its tables are those of compare and diagnose",
    "improve": "tests/e2e/test_models.py: its tables, of eighty columns",
    "investigate": "measures for minutes; its tables are those of diagnose",
    "release-whatif": "fits the archive twice; its table is that of archive diff",
    "workbench": "serves pages",
    "station-operator": "asks an orchestrator",
    "doctor": "asks an orchestrator; its table is tested in tests/unit/pipelines/doctor/test_examine.py",
    "station-program": "moves a station",
    "certificate-write": "writes documents, prints one line each",
    "correct": "prints lines, tests/e2e/test_correct.py",
    "simulate": "prints lines, tests/e2e/test_correct.py",
    "export-waveforms": "prints one line",
}


def test_every_command_has_an_output_here_or_a_reason() -> None:
    assert set(COMMANDS) == {name.partition("-")[0] for name in (*OUTPUTS, *ELSEWHERE)}
    assert not set(OUTPUTS) & set(ELSEWHERE)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a line: recipe, archive with one run, a model, a record at rest."""
    place = tmp_path_factory.mktemp("line")
    rng = np.random.default_rng(3)
    rest = pd.DataFrame(rng.normal([0.0, 0.0, 1.0], 1e-4, (3000, 3)), columns=["x", "y", "z"])
    rest.insert(0, "t", np.arange(3000) / 100.0)
    rest.to_csv(place / "rest.csv", index=False)
    (place / "m.toml").write_text(MODEL, encoding="utf-8")
    text = (ROOT / "deploy" / "lines" / "two-chambers.toml").read_text(encoding="utf-8")
    (place / "line.toml").write_text(text.replace("count = 10", "count = 4"), encoding="utf-8")
    finished_run(place)
    return place


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it for each test: what one command writes is not there for the next."""
    copy = Path(shutil.copytree(made, tmp_path / "line"))
    monkeypatch.chdir(copy)
    monkeypatch.setenv("NO_COLOR", "1")
    return copy


def printed(words: list[str], columns: int = WIDE) -> str:
    status, out, err = given(*words, columns=columns)
    assert status in {0, 1}, (words, err)
    return out


def copied(line: str) -> bool:
    """Whether a line is one that is copied: a command, a statement of a file, or one with a word longer than the terminal."""
    text = line.strip()
    return text.startswith("tumbleline ") or max(map(len, text.split()), default=0) > WIDE - 20


@pytest.mark.parametrize(
    # a diagnosis searches for the next measurement, its text: tests/e2e/test_guides.py; the table of a fit is that of a run
    "name",
    [pytest.param(one, marks=pytest.mark.slow if one in {"diagnose", "fit"} else ()) for one in OUTPUTS],
)
def test_a_command_prints_the_approved_text_in_eighty_columns(name: str, folder: Path) -> None:
    if name in BEFORE:
        printed(BEFORE[name])
    text = printed(OUTPUTS[name])
    if name != "export":  # a file, whose lines are as long as its format needs
        assert [line for line in text.splitlines() if len(line) > WIDE and not copied(line)] == []
    assert text
    if name not in UNSTEADY:
        names = {info.id: f"RUN-{number}" for number, info in enumerate(Archive("archive").runs(), 1)}
        assert not difference(name, normalised(text, folder, names))


def test_a_table_in_a_pipe_has_every_column_and_no_cell_is_cut(folder: Path) -> None:
    text = printed(["show", "small", "coefficients"], 0)
    heads = next(line for line in text.splitlines() if "effect" in line)
    assert {"unit", "effect", "name", "axis", "value"} <= set(heads.split())
    assert not re.search(r"\S…", text)
