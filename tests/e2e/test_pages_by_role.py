"""The pages for a newcomer with a spreadsheet, the operator and the auditor: their commands run and print what stands there."""

import re
import shlex
from pathlib import Path

import pytest
from capture_double import finished_run
from typer.testing import CliRunner

from pipelines.archive.signatures import VARIABLE
from pipelines.cli import app

DOCS = Path(__file__).resolve().parents[2] / "docs"
SHEET = (DOCS / "tutorial" / "from-a-spreadsheet.md").read_text(encoding="utf-8")
AUDITOR = (DOCS / "how-to" / "audit-a-laboratory.md").read_text(encoding="utf-8")
OPERATOR = (DOCS / "how-to" / "operate-the-line.md").read_text(encoding="utf-8")


def commands(page: str) -> list[tuple[str, str]]:
    """Every command of the console blocks of a page, with what is printed below it."""
    blocks = re.findall(r"```console\n(.*?)```", page, flags=re.DOTALL)
    return [
        (c, printed)
        for block in blocks
        for c, printed in re.findall(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block, re.MULTILINE)
    ]


def told(text: str) -> str:
    """A pattern for a printed text: blanks and numbers may differ, ``…`` stands for anything."""
    words = " ".join(text.split())
    return re.sub(r"\d+(?:\\?\.\d+)?(?:e\\?-\d+)?", r"[\\d.e+-]+", re.escape(words)).replace("…", ".*?")


def run(command: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, shlex.split(command)[1:], env={"COLUMNS": "80"})
    assert done.exception is None or isinstance(done.exception, SystemExit), (command, done.exception)
    return done.exit_code, " ".join(done.stdout.split())


def test_the_spreadsheet_becomes_a_model_as_the_page_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    table = re.search(r"```csv\n(.*?)```", SHEET, flags=re.DOTALL)
    assert table is not None
    Path("positions.csv").write_text(table[1], encoding="utf-8")
    examples = commands(SHEET)
    assert len(examples) == 4
    for command, printed in examples:
        status, out = run(command)
        assert status == (1 if "NOT ADEQUATE" in printed else 0)
        assert re.search(told(printed), out), (command, out)
    assert Path("positions.html").stat().st_size > 10_000


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the archive of one run."""
    folder = tmp_path_factory.mktemp("line")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        finished_run(folder)
    return folder


def test_every_command_of_the_auditor_runs(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(archive)
    monkeypatch.setenv(VARIABLE, "")
    examples = commands(AUDITOR)
    assert len(examples) == 5
    for command, _ in examples:
        status, out = run(command)
        assert status in {0, 1}, (command, status, out)
        assert out, command
    assert Path("audit.html").is_file()
    assert set(re.findall(r"^\| [^|]*\| `tumbleline (\w+)", AUDITOR, re.MULTILINE)) == {
        "verify", "show", "lineage", "diff", "audit",
    }  # fmt: skip


def test_every_command_of_the_operator_runs(archive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(archive)
    monkeypatch.setenv(VARIABLE, "")
    for command, _ in commands(OPERATOR):
        words = command.split()
        if words[1] in {
            "run",
            "doctor",
        }:  # measured in test_command_line.py and test_examine.py
            continue
        status, out = run(command)
        assert status in {0, 1}, (command, out)
        assert out, command


@pytest.mark.parametrize("name", ["operator-run", "operator-result"])
def test_the_pictures_of_the_terminal_need_no_network(name: str) -> None:
    text = (DOCS / "pictures" / f"{name}.svg").read_text(encoding="utf-8")
    assert f"../pictures/{name}.svg" in OPERATOR
    assert 'url("http' not in text
    assert "SN1" in text if name == "operator-result" else "station" in text
