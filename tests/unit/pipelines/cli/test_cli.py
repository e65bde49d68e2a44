"""Commands that answer in a fraction of a second load no more than their answer needs, and the answer is the same."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from capture_double import small_run
from in_process import command

from pipelines.certificates.ledger import Ledger
from pipelines.chain.certify import certify

SHOWN = """
import json, sys
from pipelines.cli import main
sys.argv = ["tumbleline", *sys.argv[1:]]
try:
    main()
finally:
    print(json.dumps(sorted(sys.modules)), file=sys.stderr)
"""


@pytest.fixture(scope="module")
def certified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    root = tmp_path_factory.mktemp("made") / "archive"
    run = small_run(root.parent)
    run.seal()
    certify(Ledger(root), run)
    return root, run.about["lot"]["units"][0]["serial"]


@pytest.mark.parametrize("form", [["--json"], []], ids=["json", "text"])
def test_validity_of_a_serial_is_answered_without_numpy_and_pydantic(
    certified: tuple[Path, str], form: list[str]
) -> None:
    root, serial = certified
    day = json.loads(command(["show", serial, "--archive", str(root), "--json"]).stdout)["history"][0]["from"]
    words = ["show", serial, "--at", day, "--archive", str(root), *form]
    alone = subprocess.run([sys.executable, "-c", SHOWN, *words], capture_output=True, text=True, check=True)
    loaded = set(json.loads(alone.stderr.splitlines()[-1]))
    assert "pyarrow.parquet" in loaded
    assert not {"numpy", "pandas", "scipy", "duckdb", "prefect", "pydantic"} & loaded
    here = command(words)  # numpy is loaded here
    assert "numpy" in sys.modules
    assert alone.stdout == here.stdout
    if not form:
        assert "standard error" in alone.stdout
        return
    rows = json.loads(alone.stdout)["calibration"]["coefficients"]
    assert rows
    assert {row["unit"] for row in rows} == {serial}
