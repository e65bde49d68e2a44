"""The guide to tracing a certificate: its commands run in the order in which they stand there, and say what is printed there."""

import re
import shlex
from pathlib import Path

import pytest
from capture_double import finished_run
from typer.testing import CliRunner

from pipelines.archive.signatures import VARIABLE
from pipelines.cli import app

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "trace-a-certificate.md").read_text(encoding="utf-8")
EXAMPLES = [block.partition("\n") for block in re.findall(r"```console\n\$ (.*?)```", GUIDE, flags=re.DOTALL)]
INDENTED = re.findall(r"^    (tumbleline .*)$", GUIDE, flags=re.MULTILINE)


def words_of(text: str) -> str:
    """The text with every run of blanks and of table lines as one blank."""
    return " ".join(re.sub(r"[─\s]+", " ", text).split())


def test_the_guide_tells_what_its_commands_print(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", "archive")
    run = finished_run(tmp_path)
    (tmp_path / "sent-by-mail.parquet").write_bytes((run.path / "grades.parquet").read_bytes())
    assert len(EXAMPLES) == 8
    for command, _, printed in EXAMPLES:
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == (1 if "no calibration is valid" in printed else 0), (
            command,
            done.output,
            done.exception,
        )
        wanted = re.escape(words_of(printed)).replace("…", ".*?")
        wanted = re.sub(r"202\d\\-\d\d\\-\d\d", r"\\d{4}-\\d\\d-\\d\\d", wanted)  # what is certified begins today
        assert re.match(wanted, words_of(done.stdout)), (command, done.stdout)
    for command in INDENTED:
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == 0, (command, done.exception)
        assert "raw samples" in done.stdout


def test_the_reference_names_every_place_and_key_of_an_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "")
    page = (ROOT / "docs" / "reference" / "archive.md").read_text(encoding="utf-8")
    keys = finished_run(tmp_path).manifest("coefficients").keys() | {"signature", "taken_from"}
    assert {key for key in keys if f"`{key}`" not in page} == set()
    top = {path.name for path in (tmp_path / "archive").iterdir() if path.is_dir()}
    assert {name for name in top if f"`{name}/" not in page} == set()
