"""Streams and names that are not UTF-8, as those of a pipe on Windows and of a folder from an old disk."""

import json
import os
import re
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


@pytest.mark.slow
def test_characters_that_an_encoding_lacks_stop_no_command(tmp_path: Path) -> None:
    record, noise = tmp_path / "rest.csv", 1e-4 * np.random.default_rng(7).normal(size=3000)
    rows = np.column_stack([np.arange(3000) / 100.0, noise])
    np.savetxt(record, rows, delimiter=",", header="time_s,x [g]", comments="")
    done = command("noise", "allan", str(record), encoding="cp1252")
    assert (done.returncode, done.stderr) == (0, b"")
    assert "g/?Hz" in done.stdout.decode("cp1252")


def test_a_document_in_another_encoding_is_json_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    written = BytesIO()
    monkeypatch.setattr(sys, "stdout", TextIOWrapper(written, encoding="cp1252"))
    print_json({"unit": "g/√Hz", "µ": 1.0})
    assert json.loads(written.getvalue().decode("ascii")) == {"unit": "g/√Hz", "µ": 1.0}


@pytest.mark.slow
def test_a_folder_or_a_file_whose_name_is_no_text_is_refused_in_one_message(tmp_path: Path) -> None:
    if os.name == "nt" or sys.getfilesystemencoding() != "utf-8":
        pytest.skip("names are text here")
    folder, file = os.fsencode(tmp_path) + b"/\xfc", os.fsencode(tmp_path) + b"/\xfc.csv"
    Path(os.fsdecode(file)).write_text("time_s,x [g]\n0,0\n1,0\n")
    mapped = ("--map", "time=1,x=2", "--set", "axes=x", "--units", "S1", "--archive", str(tmp_path / "a"))
    asked = (("run", "--archive", folder), "give another one with --archive"), (("import", file, *mapped), "LC_ALL")
    for words, remedy in asked:
        done = command(*words)
        assert done.returncode == UNUSABLE
        assert re.fullmatch(f"tumbleline: .*{remedy}.*", done.stderr.decode().strip())
