"""What a stage's key takes in of the code."""

import subprocess
import sys

import pytest

from pipelines.archive.code import CODE
from pipelines.archive.keys import sources


def test_a_key_takes_in_what_its_stage_uses_by_name_or_by_discovery_and_nothing_of_others() -> None:
    assert not {n for n in sources(CODE["grade"]) if n.startswith("inertial.criticism")}
    assert "inertial.fits.wander" not in sources(CODE["reduce"])
    assert {"inertial.effects.third_order", "inertial.effects.covariate"} <= set(sources(CODE["fit"]))
    assert "pipelines.procedures.sweep" in sources(CODE["procedures"])
    assert {"inertial.noise.allan", "inertial.noise"} <= set(sources(("inertial.noise",)))
    assert list(sources(CODE["fit"])) == sorted(sources(CODE["fit"]))
    for name in ("inertial.no_such_module", "no_such_package", "inertial.counts.number_of"):
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
