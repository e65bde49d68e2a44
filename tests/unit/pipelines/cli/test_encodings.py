"""Streams and names that are not UTF-8, as those of a pipe on Windows and of a folder from an old disk."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

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


def test_characters_that_an_encoding_lacks_stop_no_command(record: Path) -> None:
    done = command("noise", "allan", str(record), encoding="cp1252")
    assert (done.returncode, done.stderr) == (0, b"")
    assert "g/?Hz" in done.stdout.decode("cp1252")
    as_json = command("noise", "allan", str(record), "--json", encoding="cp1252")
    assert json.loads(as_json.stdout.decode("ascii")) == json.loads(
        command("noise", "allan", str(record), "--json").stdout.decode("utf-8")
    )


def test_a_folder_whose_name_is_no_text_is_refused_in_one_message(tmp_path: Path) -> None:
    if os.name == "nt" or sys.getfilesystemencoding() != "utf-8":
        pytest.skip("names are text here")
    done = command("run", "--archive", os.fsencode(tmp_path) + b"/\xfc")
    assert done.returncode == UNUSABLE
    message = done.stderr.decode().strip()
    assert message.startswith("tumbleline: ")
    assert message.endswith("rename it, or set LC_ALL to the encoding of its name")
    assert "\n" not in message
