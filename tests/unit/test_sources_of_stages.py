"""What a stage's key takes in of the code."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

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


def test_every_source_is_that_of_the_module_of_its_name():
    files = sources(("inertial", "schemas", "stations", "pipelines"))
    assert len(files) > 900
    for name in [*files][::9]:
        spec = find_spec(name)
        assert spec is not None, name
        assert files[name] == Path(spec.origin or ""), name


def test_the_name_of_something_inside_a_module_is_no_source():
    assert not sources(("inertial.counts.number_of", "inertial.no_such_module", "numpy.linalg"))


def test_no_module_is_imported_for_its_source():
    code = (
        "import sys; from pipelines.archive.keys import code_hash; before = set(sys.modules); "
        "code_hash(('pipelines.report', 'pipelines.procedures', 'inertial')); print(*(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stdout.split()
    assert not [name for name in imported if name.split(".")[0] in {"matplotlib", "inertial", "pipelines", "scipy"}]
