"""The examples of the guide to importing run as printed there, on the real recordings."""

import hashlib
import json
import re
import shlex
import subprocess
from contextlib import chdir
from pathlib import Path

import pytest
from in_process import command

from pipelines.importers.exchange import read_dwells

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "import-your-data.md").read_text(encoding="utf-8")
EXAMPLES = [block.partition("\n") for block in re.findall(r"```console\n\$ (.*?)```", GUIDE, flags=re.DOTALL)]
TUMBLE, CHAMBER = (
    next(c for c, _, _ in EXAMPLES if file in c and " import " in c) for file in ("xsens_acc", "imu_raw_data")
)


def run(line: str, data: Path, archive: Path, *more: str) -> subprocess.CompletedProcess[str]:
    words = shlex.split(line.replace("$DATA", str(data)))
    assert words[0] == "tumbleline"
    place = () if words[1] == "inspect" else ("--archive", str(archive))
    with chdir(ROOT):
        return command([*words[1:], *place, *more])


@pytest.mark.parametrize(("line", "printed"), [(c, p) for c, _, p in EXAMPLES], ids=range(len(EXAMPLES)))
def test_an_example_prints_what_the_guide_says(line: str, printed: str, shared_data: Path, tmp_path: Path) -> None:
    pytest.importorskip("idelib" if ".ide " in line else "numpy")
    done = run(line, shared_data, tmp_path / "archive")
    assert done.stderr == ""
    assert done.returncode == (1 if "NOT ADEQUATE" in printed else 0)
    expected = re.escape(printed.strip()).replace("…", "[0-9a-f]+")
    own = done.stdout.replace(str(shared_data), "$DATA").replace(f" --archive {tmp_path / 'archive'}", "")
    output = "\n".join(line.rstrip() for line in own.strip().splitlines())
    assert re.fullmatch(expected, output), done.stdout


@pytest.fixture(scope="module")
def tumble(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path]:
    """The document of the import of the tumble recording, and its archive."""
    archive = tmp_path_factory.mktemp("tumble") / "archive"
    return json.loads(run(TUMBLE, shared_data, archive, "--json").stdout), archive


def test_json_holds_the_whole_answer_and_nothing_else(shared_data: Path, tumble: tuple[dict, Path]) -> None:
    document, _ = tumble
    assert document["adequate"] is True
    file = shared_data / "xsens-tumble" / "xsens_acc.mat.gz"
    assert document["source"]["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
    assert (
        document["error"]["rms_ug"] < 112.0
    )  # 1.0 mm/s² without weights was published, 1.1 with the noise of each dwell


def test_the_mapping_file_of_the_guide_does_the_same(
    shared_data: Path, tmp_path: Path, tumble: tuple[dict, Path]
) -> None:
    (content,) = (block for block in re.findall(r"```toml\n(.*?)```", GUIDE, flags=re.DOTALL) if "[columns]" in block)
    file = tmp_path / "mapping.toml"
    file.write_text(content, encoding="utf-8")
    line = f"tumbleline import $DATA/xsens-tumble/xsens_acc.mat.gz --mapping {file} --fit norm --json"
    document = json.loads(run(line, shared_data, tmp_path / "archive").stdout)
    by_options, _ = tumble
    assert document == by_options


def test_an_import_is_a_run_that_other_commands_read(shared_data: Path, tumble: tuple[dict, Path]) -> None:
    document, archive = tumble
    run_id = document["run"]
    dwells = read_dwells(run_id, archive=archive)
    assert len(dwells) == 38
    shown = json.loads(run(f"tumbleline show {run_id} coefficients --json", shared_data, archive).stdout)
    assert {row["effect"] for row in shown["rows"]} == {"bias", "scale", "misalignment"}


def test_a_refused_file_leaves_nothing_behind(shared_data: Path, tmp_path: Path) -> None:
    archive = tmp_path / "archive"
    done = run(CHAMBER.replace("m/s^2", "g"), shared_data, archive)
    assert done.returncode == 2
    assert "looks like m/s^2" in done.stderr
    assert "Traceback" not in done.stderr
    assert not archive.exists()
