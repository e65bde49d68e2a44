"""Texts that a newcomer met and could not use: what they say now, and how numbers are written in them."""

from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from inertial.counts import size_text
from inertial.planning.ranges import UnseenRange
from pipelines.certificate_document.file_check import Check, CheckedFile
from pipelines.cli import app, flowing
from pipelines.cli.certificate_check import _needed  # pyright: ignore[reportPrivateUsage]
from pipelines.importers.exchange import read_dwells
from pipelines.jobs.recipes import load_recipe
from pipelines.report.unit_panels.budget import without_nothing
from schemas.errors import DataRejected, RecipeInvalid
from schemas.recipe import FaultOrder
from stations.plant.faults.catalogue import build_fault

RECIPE = """name = "hot"
device = "adxl355"
units = ["A1"]
local_gravity_m_s2 = 9.81
poses = "twelve"
verification = [[35.0, 15.0]]
temperatures_C = [TEMPERATURES]
effects = ["bias", "scale", "misalignment"]
limits = "LIMITS"
"""


def planned(folder: Path, monkeypatch: pytest.MonkeyPatch, temperatures: str, limits: str) -> tuple[int, str]:
    monkeypatch.chdir(folder)
    text = RECIPE.replace("TEMPERATURES", temperatures).replace("LIMITS", limits)
    (folder / "hot.toml").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(app, ["plan", "hot.toml"])
    return result.exit_code, result.stderr


def test_a_plan_says_what_run_would_refuse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    status, text = planned(tmp_path, monkeypatch, "298.0", "consumer")
    assert status == 0
    assert "'tumbleline run' refuses this recipe" in text
    assert "298 °C, the chamber of station simulated reaches -40 to 85 °C" in " ".join(text.split())
    _, text = planned(tmp_path, monkeypatch, "25.0", "mine.toml")
    assert "no file and no built-in limits are called 'mine.toml'" in " ".join(text.split())
    (tmp_path / "mine.toml").write_text('name = "m"\n[figures.residual_rms]\nmax = 1\nunit = "µg"\n', encoding="utf-8")
    _, text = planned(tmp_path, monkeypatch, "25.0", "mine.toml")
    assert "unknown figure 'residual_rms'" in " ".join(text.split())
    _, text = planned(tmp_path, monkeypatch, "25.0", "consumer")
    assert "refuses" not in text


def test_an_unsigned_pdf_is_not_sent_to_the_archive_that_cannot_prove_it() -> None:
    unsigned = [Check("signature", "not checked", "the PDF is not signed")]
    assert "give its XML with --archive" in _needed(CheckedFile(Path("A1_1.pdf"), checks=unsigned))
    assert "--trust FILE" in _needed(CheckedFile(Path("A1_1.xml"), checks=unsigned))
    signed = [Check("signature", "good", "as it was signed")]
    assert "--trust FILE" in _needed(CheckedFile(Path("A1_1.pdf"), checks=signed))


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [(1118.0, 3000.0, "tau 1120 to 3000 s"), (36000.0, 36000.0, "tau 36000 s"), (0.0123, 0.5, "tau 0.0123 to 0.5 s")],
)
def test_a_range_has_no_exponent(low: float, high: float, text: str) -> None:
    assert str(UnseenRange("tau", "s", low, high)) == text


@pytest.mark.parametrize(
    ("size", "text"),
    [(1, "1 byte"), (512, "512 bytes"), (18721670, "18.7 MB"), (2_000, "2.00 kB"), (123_456_789_000, "123 GB")],
)
def test_a_size_has_three_digits(size: int, text: str) -> None:
    assert size_text(size) == text


def test_missing_columns_are_named_once_with_those_that_are_there(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    pd.DataFrame({"unit": ["A"], "dwell": [1], "time_s": [0.0], "volt_x": [1.0]}).to_csv(path, index=False)
    with pytest.raises(DataRejected) as end:
        read_dwells(path)
    assert str(end.value).count("known:") <= 1
    assert "columns out_x, out_y, out_z are missing" in str(end.value)


def test_a_time_of_a_fault_is_found_by_a_similar_name() -> None:
    with pytest.raises(RecipeInvalid, match="fault door: no figure 'at'; did you mean at_s"):
        build_fault(FaultOrder(kind="door", figures={"at": 600.0}), ["A1"])


def test_a_help_text_is_broken_by_the_terminal_alone() -> None:
    text = flowing("One line\nand its end.\n\n- a list\n- stays")
    assert text == "One line and its end.\n\n- a list\n- stays"
    for line in CliRunner().invoke(app, ["program", "--help"], env={"COLUMNS": "80"}).stdout.splitlines():
        assert line.strip() != "back, and verify in two poses."  # the rest of a line that was broken twice


def test_a_contribution_of_nothing_is_not_among_the_largest() -> None:
    text = "noise of the dwells 99 %, references, as far as verification cannot show them 1 %, seat of the fixture 0 %"
    assert without_nothing(text) == text.removesuffix(", seat of the fixture 0 %")
    assert without_nothing("noise of the dwells 80 %, supply 20 %") == "noise of the dwells 80 %, supply 20 %"


def test_a_sample_recipe_that_is_not_here_is_named_with_its_path() -> None:
    with pytest.raises(RecipeInvalid) as end:
        load_recipe("line-six.toml")
    path = Path(str(end.value).rpartition("the sample of this name is ")[2])
    assert path.is_file()
    assert load_recipe(str(path)).name == "line-six"
    with pytest.raises(RecipeInvalid) as end:
        load_recipe("line-seven.toml")
    assert "sample" not in str(end.value)
