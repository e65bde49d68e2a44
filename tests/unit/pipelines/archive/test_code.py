"""What a stage's key takes in of the code."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from pipelines.archive.code import CODE
from pipelines.archive.keys import sources


def test_a_stage_does_not_depend_on_what_only_others_use():
    assert not {n for n in sources(CODE["grade"]) if n.startswith("inertial.criticism")}
    assert "inertial.fits.wander" not in sources(CODE["reduce"])


def test_every_effect_and_every_procedure_counts_although_nothing_names_it():
    assert {"inertial.effects.third_order", "inertial.effects.covariate"} <= set(sources(CODE["fit"]))
    assert "pipelines.procedures.sweep" in sources(CODE["procedures"])


def test_a_package_stands_for_everything_below_it():
    assert {"inertial.noise.allan", "inertial.noise"} <= set(sources(("inertial.noise",)))


def test_the_order_is_that_of_names_wherever_the_product_lies():
    modules = list(sources(CODE["fit"]))
    assert modules == sorted(modules)


def test_every_source_is_that_of_the_module_of_its_name():
    files = sources(("inertial", "schemas", "stations", "pipelines"))
    assert len(files) > 900
    for name in [*files][::9]:
        spec = find_spec(name)
        assert spec is not None, name
        assert files[name] == Path(spec.origin or ""), name


@pytest.mark.parametrize("name", ["inertial.no_such_module", "no_such_package", "inertial.counts.number_of"])
def test_a_declared_module_that_is_not_there_is_an_error(name):
    with pytest.raises(LookupError, match=name):
        sources((name,))


def test_no_module_is_imported_for_its_source():
    code = (
        "import sys; from pipelines.archive.keys import code_hash; before = set(sys.modules); "
        "code_hash('report'); print(*(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    imported = done.stdout.split()
    assert not [name for name in imported if name.split(".")[0] in {"matplotlib", "inertial", "pipelines", "scipy"}]
