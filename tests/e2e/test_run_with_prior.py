"""A recipe with a prior: its share in table, budget and summary; a unit that does not fit its family gets the full plan."""

from pathlib import Path

import pytest
from capture_double import BRIEF, recipe_file
from family_archive import LOTS, UNITS, family_archive, wafer_of
from in_process import document_of, refused, text_of

from pipelines.archive import Archive


def with_prior(folder: Path, prior: str = 'full = "full.toml"') -> str:
    """The brief recipe with a prior, beside the same one without it."""
    recipe_file(folder, *BRIEF, ('name = "small"', 'name = "full"'), name="full.toml")
    path = Path(recipe_file(folder, *BRIEF, ('name = "small"', 'name = "quick"'), name="quick.toml"))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[prior]\n{prior}\n", encoding="utf-8")
    return str(path)


@pytest.mark.slow
@pytest.mark.usefixtures("no_next_measurement")
def test_a_lot_of_the_family_is_fitted_with_its_prior(tmp_path: Path) -> None:
    """The family's spread is that of the preset; a station's own error of the bias is far below it, so its share is small."""
    recipe, root = with_prior(tmp_path), tmp_path / "archive"
    family_archive(root, recipe_file(tmp_path, *BRIEF), 5e-3)
    found = document_of("run", recipe, "--direct", "--archive", root, "--units", "U1,U2,U3")
    assert found["prior"]["units"] == LOTS * UNITS
    assert found["prior"]["foreign"] == {}
    run = Archive(root).run(found["run"])
    table = run.table("prior")
    assert len(table) == 3 * 3 * 4
    assert table["share"].between(0.0, 1.0).all()
    budget = run.table("budget").query("quantity == 'bias'")
    of_prior, of_noise = (budget.query(f"contribution == '{name}'")["u"].to_numpy() for name in ("prior", "noise"))
    share = table.query("effect == 'bias'")["share"].to_numpy()
    assert of_prior**2 / (of_prior**2 + of_noise**2) == pytest.approx(share)
    assert run.manifest("coefficients")["parameters"]["prior"]["units"] == LOTS * UNITS
    assert [other.recipe for other in Archive(root).runs() if other.recipe == "full"] == []
    text_of("rerun", run.id, "--archive", root, "--check")


@pytest.mark.slow  # the prior itself: tests/unit/pipelines/jobs/test_priors.py
@pytest.mark.usefixtures("no_next_measurement")
def test_a_unit_whose_wafer_is_known_leans_on_it(tmp_path: Path) -> None:
    recipe, root = with_prior(tmp_path, 'attribute = "wafer"'), tmp_path / "archive"
    family_archive(root, recipe_file(tmp_path, *BRIEF), 5e-3)
    rows = [f"E{lot:02d}-{k},{wafer_of(lot, k)}" for lot in range(LOTS) for k in range(UNITS)]
    wafers = tmp_path / "wafers.csv"
    wafers.write_text("\n".join(["serial,wafer", *rows, "U1,W03"]) + "\n", encoding="utf-8")
    text_of("attributes", "add", wafers, "--archive", root)
    found = document_of("run", recipe, "--direct", "--archive", root, "--units", "U1,U2")
    assert found["prior"]["groups"] == {"U1": "wafer W03"}
    assert found["prior"]["own"] == []
    assert "earlier units of wafer W03 count for U1" in text_of("show", found["run"], "--archive", root)
    text_of("rerun", found["run"], "--archive", root, "--check")


@pytest.mark.slow
@pytest.mark.usefixtures("no_next_measurement")
def test_a_unit_that_does_not_fit_gets_the_full_plan(tmp_path: Path) -> None:
    recipe, root = with_prior(tmp_path), tmp_path / "archive"
    family_archive(root, recipe_file(tmp_path, *BRIEF), 1e-5)
    told = text_of("run", recipe, "--direct", "--archive", root, "--units", "U1")
    assert "U1 does not fit its family (p = " in told
    names = [run.recipe for run in Archive(root).runs() if run.recipe in {"quick", "full"}]
    assert sorted(names) == ["full", "quick"]


@pytest.mark.slow  # by the orchestrator
def test_a_lot_whose_prior_is_widened_gets_the_full_plan(tmp_path: Path) -> None:
    recipe, root = with_prior(tmp_path), tmp_path / "archive"
    family_archive(root, recipe_file(tmp_path, *BRIEF), 1e-5)
    found = document_of("run", recipe, "--archive", root, "--units", "U1,U2,U3")
    assert found["prior"]["foreign"] == {}
    assert found["prior"]["widened"]["bias"] > 10.0
    assert {run.recipe for run in Archive(root).runs()} >= {"quick", "full"}


def test_a_full_plan_with_a_prior_is_refused(tmp_path: Path) -> None:
    recipe, root = with_prior(tmp_path, 'full = "quick.toml"'), tmp_path / "archive"
    family_archive(root, recipe_file(tmp_path, *BRIEF), 1e-3)
    other = Path(recipe).with_name("full.toml")
    other.write_text(f"{other.read_text(encoding='utf-8')}\n[prior]\n", encoding="utf-8")
    text = Path(recipe).read_text(encoding="utf-8").replace("quick.toml", "full.toml")
    Path(recipe).write_text(text, encoding="utf-8")
    told = refused("run", recipe, "--direct", "--archive", root, "--units", "U1")
    assert "key 'prior.full': full measures adxl355 with a prior" in told
