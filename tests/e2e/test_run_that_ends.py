"""Recipes with ``[stop]``, which end when their units are known, and with ``[prior]``, whose family counts."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from capture_double import AT_ROOM, BRIEF, recipe_file
from family_archive import LOTS, UNITS, family_archive
from in_process import document_of, refused, text_of

from pipelines.archive import Archive
from pipelines.certificates.document.circumstances import methods
from pipelines.certificates.document.laboratory import LaboratoryFile

OFFSETS = """
name = "offsets"
grade = "none"
[figures]
zero_g_offset_mg = { max = 75.0, unit = "mg" }
"""


def ending(folder: Path) -> str:
    changes = (
        *AT_ROOM[:2],
        ('["A1", "A2", "A3"]', '["A1"]'),
        ('limits = "consumer"', 'limits = "offsets.toml"'),
        ('poses = "nine"', 'poses = "orthogonal24"'),
        ("static_record_s = 30.0", 'static_record_s = 0.0\nverification_order = "interleaved"'),
    )
    path = Path(recipe_file(folder, *changes))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[stop]\nbias_ug = 900.0\n", encoding="utf-8")
    (folder / "offsets.toml").write_text(OFFSETS, encoding="utf-8")
    return str(path)


@pytest.mark.slow
def test_a_run_that_ends_early_says_so_everywhere(tmp_path: Path) -> None:
    root = tmp_path / "archive"
    found = document_of("run", ending(tmp_path), "--direct", "--archive", root)
    end = found["early_end"]
    assert end["ended"]
    assert "third_order" not in end["given_up"]
    sentence = f"ended when it was known: {end['reason']}"
    assert sentence in text_of("show", found["run"], "--archive", root)
    assert sentence in Path(found["report"]).read_text(encoding="utf-8")
    run = Archive(root).run(found["run"])
    laboratory = LaboratoryFile.model_construct(method=SimpleNamespace(procedure=""))
    about = methods(run, "A1", run.about["recipe"], laboratory, (), static=True)
    assert any(sentence in line for line in about)
    assert end["not_reached"] == []
    text_of("rerun", found["run"], "--archive", root, "--check")
    # by another model the lot might not have ended: the look was that of the first run
    effects = "bias,scale,misalignment,second_order"
    again = document_of("rerun", found["run"], "--effects", effects, "--archive", root)
    shown = text_of("show", again["runs"][0]["new"], "--archive", root)
    assert f"(by run {found['run']}, which measured it)" in shown


def test_an_order_needs_to_know_what_is_asked_for_and_refuses_what_a_run_refuses(tmp_path: Path) -> None:
    assert "no table [stop]" in refused("plan", "order", recipe_file(tmp_path))
    path = Path(ending(tmp_path))
    path.write_text(f'{path.read_text(encoding="utf-8")}visible = ["no_such"]\n', encoding="utf-8")
    said = refused("plan", "order", path)
    assert "stop.visible: unknown effect 'no_such'" in said
    assert said == refused("run", path, "--direct", "--archive", tmp_path / "archive")


def test_an_order_does_not_replace_the_recipe_that_it_is_made_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(ending(tmp_path))
    text = path.read_text(encoding="utf-8").replace('name = "small"', 'name = "small-ordered"')
    path.write_text(text, encoding="utf-8")
    path = path.rename(tmp_path / "small-ordered.toml")
    assert "small-ordered.toml is the given recipe" in refused("plan", "order", path)
    assert path.read_text(encoding="utf-8") == text
    said = text_of("plan", "order", path, "--output", "first.toml")
    assert "limits and visible effects left out" in said


@pytest.mark.slow
def test_the_recipe_of_an_order_is_usable(tmp_path: Path) -> None:
    path = Path(recipe_file(tmp_path, ("[0.0, 50.0]", "[0.0, 25.0, 50.0, 25.0]"), ('units = ["A1", "A2", "A3"]\n', "")))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[stop]\n", encoding="utf-8")
    target = tmp_path / "first.toml"
    found = document_of("plan", "order", path, "--output", target)
    assert found["known_minutes"] <= found["given_known_minutes"]
    assert sorted(found["temperatures_C"]) == [0.0, 25.0, 25.0, 50.0]
    assert document_of("plan", target)["dwells"] == document_of("plan", path)["dwells"]


def with_prior(folder: Path, prior: str = 'full = "full.toml"') -> str:
    """The brief recipe with a prior, beside the same one without it."""
    recipe_file(folder, *BRIEF, ('name = "small"', 'name = "full"'), name="full.toml")
    path = Path(recipe_file(folder, *BRIEF, ('name = "small"', 'name = "quick"'), name="quick.toml"))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n[prior]\n{prior}\n", encoding="utf-8")
    return str(path)


@pytest.mark.slow
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
    assert [other.recipe for other in Archive(root).runs() if other.recipe == "full"] == []
    text_of("rerun", run.id, "--archive", root, "--check")


@pytest.mark.slow
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
