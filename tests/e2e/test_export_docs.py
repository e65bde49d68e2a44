"""The guide to exports: its commands run as they stand there and print what is printed there."""

import re
import shlex
from pathlib import Path

import pytest
from capture_double import finished_run
from typer.testing import CliRunner

from pipelines.archive.signatures import VARIABLE
from pipelines.cli import app

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "export.md").read_text(encoding="utf-8")
EXAMPLES = [
    line.partition("\n")
    for block in re.findall(r"```console\n(.*?)```", GUIDE, flags=re.DOTALL)
    for line in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
]


def test_the_guide_to_exports_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "archive")
    finished_run(tmp_path)
    assert len(EXAMPLES) == 4
    for command, _, printed in EXAMPLES:
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == 0, (command, done.output, done.exception)
        wanted = re.escape(printed.strip()).replace("…", ".*?")
        shown = done.stdout or "\n".join(line for line in done.stderr.splitlines() if "files in" in line)
        assert re.fullmatch(wanted, shown.strip(), flags=re.DOTALL) or not printed.strip(), (command, done.output)
    assert len(list(Path("parameters").glob("*.param"))) == 3
    assert "CAL_ACC0_ID\t1310988\t6" in Path("A1.params").read_text(encoding="utf-8")
    assert "per_count" in Path("calibration.h").read_text(encoding="utf-8")


def test_files_of_several_units_need_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    finished_run(tmp_path)
    words = ["export", "latest", "--format", "ardupilot", "--nominal", "256000"]
    done = CliRunner().invoke(app, words)
    assert "3 units, each needs a file of its own" in str(done.exception)
    assert "is not text" in str(CliRunner().invoke(app, ["export", "latest", "--format", "matlab"]).exception)
    assert (
        CliRunner().invoke(app, [*words, "--units", "A2"]).stdout.startswith("# accelerometer calibration of unit A2")
    )
