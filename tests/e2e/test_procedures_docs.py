"""The sample recipe of each procedure is there, is what the guide prints, and runs as printed."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.jobs.recipes import load_limits, load_recipe
from pipelines.procedures import PROCEDURES, figures_of_recipe, parts_of, refuse_unusable
from schemas.station import load_station

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "list-procedures.md").read_text(encoding="utf-8")
PRINTED = re.findall(r"^\$ tumbleline run (deploy/recipes/procedures/\S+)$", GUIDE, re.MULTILINE)


def test_every_procedure_with_figures_has_a_printed_command() -> None:
    assert {Path(one).stem for one in PRINTED} == {name for name, one in PROCEDURES.items() if one.figures}


@pytest.mark.parametrize("printed", PRINTED)
def test_a_sample_recipe_is_one_that_the_built_in_station_can_perform(printed: str) -> None:
    recipe = load_recipe(str(ROOT / printed))
    assert [part.kind for part in parts_of(recipe)] == [Path(printed).stem]
    refuse_unusable(recipe, load_station())
    assert set(load_limits(recipe, (ROOT / printed).parent).figures) <= set(figures_of_recipe(recipe))


@pytest.mark.slow
@pytest.mark.parametrize("printed", PRINTED)
def test_a_sample_recipe_runs_as_printed(printed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    done = CliRunner().invoke(app, ["run", printed, "--archive", str(tmp_path / "archive"), "--direct"])
    assert done.exit_code == 0, done.output
    assert "2 of 2 passed" in done.output
