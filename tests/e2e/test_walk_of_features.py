"""The commands of the list of features are given as they stand there: each ends with a result."""

import re
import shlex
import shutil
from contextlib import chdir
from pathlib import Path

import pytest
from help_examples import ROOT, line, papers, recordings
from in_process import command

from schemas.errors import DONE, PART_FAILED

PAGE = (ROOT / "docs" / "reference" / "features.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (?P<feature>.+?) \| .*\| `(?P<command>tumbleline [^`]+)` \|$", PAGE, re.MULTILINE)
UNITS = "SN1,SN2,SN3"
GIVEN = list(dict.fromkeys(words for _, words in ROWS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one run, a copy of its archive, and the recordings that the commands name."""
    place = tmp_path_factory.mktemp("features")
    with chdir(place):
        line(place)
        done = command(["run", "my.toml", "--station", "line-1.toml", "--direct", "--units", UNITS])
        assert done.returncode in {DONE, PART_FAILED}, done.stderr
        recordings(place)
        papers(place)
        shutil.copytree("archive", "copy")
        (place / "deploy").symlink_to(ROOT / "deploy")
    return place


def given(words: str) -> str:
    """Empty where a command ends with a result, else what it said."""
    typed = shlex.split(words)[1:]
    direct = ["--direct", "--archive", "procedures"] if typed[0] == "run" else []
    done = command([*typed, *direct])
    whole = done.returncode in {DONE, PART_FAILED} and "defect" not in done.stderr
    return "" if whole else f"{words}: {done.returncode}: {done.stderr[-400:]}"


def test_every_row_of_the_first_tables_has_a_command_and_open_rows_are_named() -> None:
    tables = PAGE[: PAGE.index("| open |")]
    features = [row for row in re.findall(r"^\| (.+?) \| .* \|$", tables, re.MULTILINE) if row not in HEADS]
    assert [feature for feature in features if feature not in {name for name, _ in ROWS}] == []
    assert len(ROWS) > 35
    assert len(PAGE[PAGE.index("| open |") : PAGE.index("| production |")].splitlines()) > 6


HEADS = {"simulated devices", "models", "tests and figures"}


@pytest.mark.slow  # each exists with its options: tests/contract/test_printed_commands.py; and has a test of its own
@pytest.mark.timeout(900)
def test_the_commands_of_the_list_of_features_end_with_a_result(folder: Path) -> None:
    with chdir(folder):
        wrong = [text for text in map(given, GIVEN) if text]
    assert wrong == []
