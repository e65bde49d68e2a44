"""Streams and names that are not UTF-8, as those of a pipe on Windows and of a folder from an old disk."""

import json
import os
import shutil
import subprocess
import sys
from io import BytesIO, TextIOWrapper
from pathlib import Path

import numpy as np
import pytest

from pipelines.cli.printing import print_json
from schemas.errors import UNUSABLE


def command(*given: str | bytes, encoding: str = "utf-8") -> subprocess.CompletedProcess[bytes]:
    program = (sys.executable, "-c", "from pipelines.cli import main; main()")
    return subprocess.run(
        [*program, *given], env={**os.environ, "PYTHONIOENCODING": encoding}, capture_output=True, check=False
    )


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("given") / "rest.csv"
    noise = 1e-4 * np.random.default_rng(7).normal(size=(3000, 1))
    np.savetxt(
        path, np.hstack([np.arange(3000)[:, None] / 100.0, noise]), delimiter=",", header="time_s,x [g]", comments=""
    )
    return path


@pytest.mark.slow
def test_characters_that_an_encoding_lacks_stop_no_command(record: Path) -> None:
    done = command("noise", "allan", str(record), encoding="cp1252")
    assert (done.returncode, done.stderr) == (0, b"")
    assert "g/?Hz" in done.stdout.decode("cp1252")


def test_a_document_in_another_encoding_is_json_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    written = BytesIO()
    monkeypatch.setattr(sys, "stdout", TextIOWrapper(written, encoding="cp1252"))
    print_json({"unit": "g/√Hz", "µ": 1.0})
    assert json.loads(written.getvalue().decode("ascii")) == {"unit": "g/√Hz", "µ": 1.0}


@pytest.mark.slow
def test_a_folder_or_a_file_whose_name_is_no_text_is_refused_in_one_message(record: Path, tmp_path: Path) -> None:
    if os.name == "nt" or sys.getfilesystemencoding() != "utf-8":
        pytest.skip("names are text here")
    folder, file = os.fsencode(tmp_path) + b"/\xfc", os.fsencode(tmp_path) + b"/\xfc.csv"
    shutil.copy(record, file)
    mapped = (
        "--map",
        "time=time_s,x=x [g]",
        "--set",
        "axes=x",
        "--units",
        "S1",
        "--archive",
        str(tmp_path / "archive"),
    )
    for words, remedy in (
        (("run", "--archive", folder), "give another one with --archive"),
        (("import", file, *mapped), "LC_ALL"),
    ):
        done = command(*words)
        assert done.returncode == UNUSABLE
        message = done.stderr.decode().strip()
        assert message.startswith("tumbleline: ")
        assert remedy in message
        assert "\n" not in message
