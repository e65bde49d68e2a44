"""What a stage's key takes in of the code."""

from pipelines.archive.keys import sources
from pipelines.chain.chain import STAGES


def names(stage):
    return set(sources(next(s for s in STAGES if s.name == stage).modules))


def test_a_stage_depends_on_what_it_imports_at_any_depth():
    assert {"inertial.fits.wander", "inertial.state", "schemas.errors", "pipelines.stages.nonlinear"} <= names("fit")


def test_a_stage_does_not_depend_on_what_only_others_use():
    assert not {n for n in names("grade") if n.startswith("inertial.criticism")}
    assert "inertial.fits.wander" not in names("reduce")


def test_every_effect_counts_although_nothing_names_it():
    assert {"inertial.effects.third_order", "inertial.effects.covariate"} <= names("fit")


def test_what_only_type_checkers_read_does_not_count():
    assert "pipelines.jobs.job" not in names("fit")


def test_a_package_stands_for_everything_below_it():
    assert {"inertial.noise.allan", "inertial.noise"} <= set(sources(("inertial.noise",)))


def test_the_order_is_that_of_names_wherever_the_product_lies():
    modules = list(sources(("pipelines.stages.fit",)))
    assert modules == sorted(modules)
