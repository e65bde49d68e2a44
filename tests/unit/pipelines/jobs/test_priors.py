"""The family of a recipe's device, from an archive: which calibrations count, what is refused, and what a run keeps of it."""

import shutil
from datetime import date
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import BRIEF, recipe_file
from family_archive import LOTS, LSB, UNITS, family_archive, wafer_of

from pipelines.archive import Archive
from pipelines.discovery.attributes import add_attributes
from pipelines.jobs.priors import family, planned_precision, stored_family
from pipelines.jobs.recipes import load_recipe
from pipelines.tables.calibration import column_names
from schemas.errors import RecipeInvalid
from schemas.prior import PriorTerms, StoredFamily
from schemas.recipe import Recipe

SPREAD = 1e-3


def middle(recipe: Recipe) -> np.ndarray:
    """The mean of the family, (axes, coefficients)."""
    return np.array([[effect == "scale" for effect, _ in axis] for axis in column_names(recipe.effects)])


@pytest.fixture
def recipe(tmp_path: Path) -> Recipe:
    return load_recipe(recipe_file(tmp_path, *BRIEF)).model_copy(update={"prior": PriorTerms()})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("family")
    return family_archive(folder / "archive", recipe_file(folder, *BRIEF), SPREAD)


@pytest.fixture
def archive(made: Archive, tmp_path: Path) -> Archive:
    shutil.copytree(str(made.root), tmp_path / "archive")
    return Archive(tmp_path / "archive")


def test_the_family_is_that_of_the_archive_without_the_units_of_the_lot_and_a_plan_has_its_precision_in_g(
    recipe: Recipe, archive: Archive
) -> None:
    stored = stored_family(recipe, archive, set(), "simulated")
    assert (stored.units, stored.lots, len(stored.runs)) == (LOTS * UNITS, LOTS, LOTS)
    own = family(StoredFamily.model_validate_json(stored.model_dump_json()))
    spread = np.sqrt(np.diagonal(own.unit + own.lot, axis1=-2, axis2=-1))
    assert spread == pytest.approx(LSB * SPREAD, rel=0.5)
    np.testing.assert_allclose(own.mean, stored.mean)
    stored = stored_family(recipe, archive, {"E00-0", "E05-3"}, "simulated")
    assert stored.units == LOTS * UNITS - 2
    precision = planned_precision(recipe, str(archive.root), "simulated")
    # the predicted spread is wider than that of the calibrations
    assert np.sqrt(np.diagonal(np.linalg.inv(precision), axis1=-2, axis2=-1)) == pytest.approx(SPREAD, rel=0.6)


def test_units_that_were_calibrated_before_have_a_prior_of_their_own(
    recipe: Recipe, archive: Archive, tmp_path: Path
) -> None:
    family_archive(Path(str(archive.root)), recipe_file(tmp_path, *BRIEF), SPREAD, name="again")
    found = family(stored_family(recipe, archive, {"E03-1", "new"}, "simulated"))
    assert list(found.own) == ["E03-1"]
    mean, covariance = found.own["E03-1"]
    first = np.random.default_rng([7, 3]).standard_normal((UNITS, 3, 4))[1]
    np.testing.assert_allclose(mean, LSB * (middle(recipe) + SPREAD * first), atol=3.0)
    assert np.all(np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)) < 0.02 * LSB * SPREAD)
    of_family, of_units = (
        planned_precision(one, str(archive.root), "simulated")
        for one in (recipe.model_copy(update={"units": []}), recipe.model_copy(update={"units": ["E03-1"]}))
    )
    assert np.all(np.diagonal(of_units, axis1=-2, axis2=-1) > 100.0 * np.diagonal(of_family, axis1=-2, axis2=-1))


def test_a_unit_leans_on_its_wafer(recipe: Recipe, tmp_path: Path) -> None:
    wafers = 5.0 * SPREAD
    archive = family_archive(tmp_path / "wafers", recipe_file(tmp_path, *BRIEF), SPREAD, wafers=wafers)
    known = [(f"E{lot:02d}-{k}", wafer_of(lot, k)) for lot in range(LOTS) for k in range(UNITS)]
    table = pd.DataFrame([*known, ("new", "W03"), ("other", "W99")], columns=["serial", "wafer"])
    add_attributes(archive, table, "serial", "map.csv")
    leaning = recipe.model_copy(update={"prior": PriorTerms(attribute="wafer")})
    stored = stored_family(leaning, archive, {"new", "other", "unknown"}, "simulated")
    found = family(stored)
    assert stored.groups == {"new": "wafer W03"}
    mean, covariance = found.own["new"]
    true = LSB * (middle(recipe) + wafers * np.random.default_rng([8, 3]).standard_normal((3, 4)))
    u = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    assert np.mean(np.abs(mean - true) < 2.0 * u) > 0.8
    whole = np.sqrt(np.diagonal(found.within + found.between, axis1=-2, axis2=-1))
    assert np.mean(u / whole) < 0.8
    with pytest.raises(RecipeInvalid, match=r"no attribute 'wafre'.* did you mean wafer\?"):
        stored_family(recipe.model_copy(update={"prior": PriorTerms(attribute="wafre")}), archive, set(), "simulated")


def test_calibrations_that_say_nothing_of_the_family_do_not_count_and_an_archive_without_one_is_refused(
    recipe: Recipe, archive: Archive, tmp_path: Path
) -> None:
    root, name = Path(str(archive.root)), recipe_file(tmp_path, *BRIEF)
    family_archive(root, name, SPREAD, effects=["bias", "scale"], name="another-model")
    family_archive(root, name, SPREAD, device="sf1500", name="another-device")
    stored = stored_family(recipe, archive, set(), "simulated")
    assert stored.units == LOTS * UNITS
    for changes, kind, what in (
        ({"device": "qa700"}, "simulated", "no calibration of qa700 with this model"),
        ({}, "modbus", "no calibration of adxl355 with this model"),
        ({"prior": PriorTerms(since=date(2999, 1, 1))}, "simulated", "no calibration"),
    ):
        with pytest.raises(RecipeInvalid, match=what):
            stored_family(recipe.model_copy(update=changes), archive, set(), kind)
    small = family_archive(tmp_path / "small", name, SPREAD, lots=4)
    with pytest.raises(RecipeInvalid, match=r"16 calibrations in 4 lots, 4 coefficients need 8 lots"):
        stored_family(recipe, small, set(), "simulated")
    plain = recipe.model_copy(update={"prior": None})
    assert stored_family(plain, Archive(tmp_path / "none"), set(), "simulated") is None
