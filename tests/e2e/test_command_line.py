"""The command line on the simulated station: what it prints, where, and with which status."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from capture_double import recipe_file
from typer.testing import CliRunner

from pipelines.cli import app


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An archive with one run of a small lot, made by the command itself without the orchestrator."""
    folder = tmp_path_factory.mktemp("line")
    result = CliRunner().invoke(
        app, ["run", recipe_file(folder), "--direct", "--json", "--archive", str(folder / "archive")]
    )
    assert result.exit_code in (0, 1), result.output
    (folder / "run.json").write_text(result.stdout, encoding="utf-8")
    (folder / "run.err").write_text(result.stderr, encoding="utf-8")
    return folder / "archive"


def ask(archive: Path, *arguments: str) -> dict:
    result = CliRunner().invoke(app, [*arguments, "--json", "--archive", str(archive)])
    assert result.exit_code in (0, 1), result.output
    return json.loads(result.stdout)


def test_run_prints_one_json_document_and_tells_its_stages_elsewhere(archive: Path) -> None:
    document = json.loads((archive.parent / "run.json").read_text(encoding="utf-8"))
    assert [unit["unit"] for unit in document["units"]] == ["A1", "A2", "A3"]
    assert document["passed"] + document["failed"] + document["refused"] == 3
    assert Path(document["report"]).is_file()
    told = (archive.parent / "run.err").read_text(encoding="utf-8")
    assert [line.split()[0] for line in told.splitlines() if line][:3] == ["capture", "validate", "reduce"]


def test_every_figure_has_value_uncertainty_limit_and_rule(archive: Path) -> None:
    unit = json.loads((archive.parent / "run.json").read_text(encoding="utf-8"))["units"][0]
    figure = unit["figures"]["verification_norm_ug"]
    assert figure["limit"] == 1000.0
    assert figure["unit_text"] == "µg"
    assert "ILAC-G8" in figure["rule"]


def test_list_show_and_report_find_the_run(archive: Path) -> None:
    run = ask(archive, "list")["runs"][0]
    assert run["finished"]
    assert ask(archive, "show", run["id"])["tables"][:3] == ["allan", "budget", "budget_covariance"]
    assert ask(archive, "report")["report"].endswith("report.html")


def test_every_statistic_of_the_static_record_of_a_run_is_made_from_its_samples(archive: Path) -> None:
    usual = ask(archive, "allan", "latest")
    total = ask(archive, "allan", "latest", "--statistic", "total")
    assert (total["statistic"], total["deviation_unit"], usual["deviation_unit"]) == ("total", "µg", "µg")
    assert [curve["channel"] for curve in total["curves"]] == [curve["channel"] for curve in usual["curves"]]
    assert total["terms"] == usual["terms"]
    for mine, own in zip(total["curves"], usual["curves"], strict=True):
        # at one sample the total deviation has two more differences than the Allan deviation, and no other
        assert mine["deviation"][0] == pytest.approx(own["deviation"][0], rel=0.01)
    assert ask(archive, "allan", "latest", "--statistic", "mtie")["deviation_unit"] == "m/s"


def test_show_prints_a_table(archive: Path) -> None:
    rows = ask(archive, "show", "latest", "coefficients")["rows"]
    assert rows[0]["effect"] == "bias"
    assert rows[0]["unit_text"] == "LSB"


def test_tables_for_people_name_every_slot(archive: Path) -> None:
    result = CliRunner().invoke(app, ["show", "--archive", str(archive)])
    assert all(unit in result.stdout for unit in ("A1", "A2", "A3"))
    assert "report" in result.stdout


def test_fit_with_other_effects_is_a_run_beside_the_old_one(archive: Path) -> None:
    before = len(ask(archive, "list")["runs"])
    document = ask(
        archive, "fit", "small", "--effects", "bias,scale,misalignment,bias_temperature,scale_temperature,second_order"
    )
    assert "second_order" in document["effects"]
    assert len(ask(archive, "list")["runs"]) == before + 1


def test_export_writes_what_the_reader_asked_for(archive: Path, tmp_path: Path) -> None:
    target = tmp_path / "calibration.h"
    run = json.loads((archive.parent / "run.json").read_text(encoding="utf-8"))["run"]
    arguments = ["export", run, "--failed", "--format", "c", "--output", str(target), "--archive", str(archive)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert "tumbleline_A1" in target.read_text(encoding="utf-8")


def test_help_imports_nothing_heavy() -> None:
    code = "import sys; from pipelines.cli import app; app(['--help'], standalone_mode=False); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not loaded & {"numpy", "pandas", "scipy", "prefect", "pymodbus", "matplotlib", "pydantic", "pyarrow"}


def test_help_answers_at_once() -> None:
    best = min(_processor_seconds([sys.executable, "-m", "pipelines.cli", "--help"]) for _ in range(5))
    assert best <= 0.3


def _processor_seconds(command: list[str]) -> float:
    """Processor time of a command, which other work on the machine does not lengthen."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, capture_output=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


FIRST_LINE = """
import sys
import pipelines.cli.diagnose as module

class Stop:
    def status(self, text):
        print(*sys.modules)
        sys.exit()

module.error_console = Stop
sys.argv = ["tumbleline", "diagnose", "latest", "--archive", sys.argv[1]]
from pipelines.cli import main
main()
"""


def test_diagnose_shows_its_first_line_before_it_loads_what_only_the_diagnosis_needs(archive: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FIRST_LINE, str(archive)], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "pandas" in loaded
    assert not loaded & {"scipy.stats", "scipy.io", "matplotlib", "prefect", "pymodbus", "duckdb", "jinja2"}
