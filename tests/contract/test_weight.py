"""What a user installs: no more packages than are needed, none that the code does not find, no licence that is not told."""

import re
import sys
import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from deploy.weight import closure, megabytes, table
from schemas.locks import UNUSED

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("inertial", "schemas", "stations", "pipelines", "tumbleline")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MOST_PACKAGES, MOST_MB = 110, 650.0
packages = cache(metadata.packages_distributions)


def modules_of(distributions: set[str]) -> set[str]:
    """Names that can be imported from some installed distributions."""
    return {
        module for module, names in packages().items() if {canonicalize_name(name) for name in names} & distributions
    }


def names(requirements: list[str]) -> set[str]:
    """Distributions of a list of requirements, with those of extras of this product."""
    found: set[str] = set()
    for one in map(Requirement, requirements):
        if one.name == PROJECT["name"]:
            found |= {name for extra in one.extras for name in names(PROJECT["optional-dependencies"][extra])}
        else:
            found.add(canonicalize_name(one.name))
    return found


FOR_USERS = PROJECT["optional-dependencies"].keys() - {"build", "dev", "bench", "docs"}
EXTRAS = names([f"{PROJECT['name']}[{','.join(FOR_USERS)}]"])
IMPORT = re.compile(r"^( *)(?:from(?= [\w.]+ import )|import(?= [\w.]+(?: as \w+)?$)) (\w+)", re.MULTILINE)


@pytest.fixture(scope="module")
def imported() -> dict[Path, dict[str, set[str]]]:
    """The imports of every module that is shipped, of other distributions only: at its top, and inside functions and blocks."""
    own = set(sys.stdlib_module_names) | set(SHIPPED)
    found: dict[Path, dict[str, set[str]]] = {}
    for path in sorted(path for top in SHIPPED for path in (ROOT / top).rglob("*.py")):
        found[path.relative_to(ROOT)] = {"top": set(), "inside": set()}
        for indented, module in IMPORT.findall(path.read_text(encoding="utf-8")):
            found[path.relative_to(ROOT)]["inside" if indented else "top"] |= {module} - own
    return found


def beyond(imported: dict[Path, dict[str, set[str]]], where: str, there: set[str]) -> dict[str, list[str]]:
    """By file, the imports of a kind of what is not there."""
    return {str(path): sorted(found[where] - there) for path, found in imported.items() if found[where] - there}


def test_no_module_imports_what_is_neither_a_dependency_nor_inside_a_function_an_extra(imported) -> None:
    needed = closure(PROJECT["dependencies"])
    assert beyond(imported, "top", modules_of(needed)) == {}
    # prefect-dask is reached by the option --dask alone, which asks for the extra first
    assert beyond(imported, "inside", modules_of(needed | EXTRAS | closure(["prefect-dask"]))) == {}


def test_what_the_locks_leave_out_is_asked_for_by_the_library_and_by_no_module(imported) -> None:
    everything = {module for found in imported.values() for modules in found.values() for module in modules}
    assert not everything & {"matplotlib", "pyreadr"}
    for library, unused in UNUSED.items():
        asked = {canonicalize_name(Requirement(line).name) for line in metadata.requires(library) or ()}
        assert unused <= asked
        assert not unused & everything


def test_the_installed_product_is_no_larger_than_is_told() -> None:
    packages = closure(PROJECT["dependencies"])
    assert len(packages) <= MOST_PACKAGES
    assert sum(map(megabytes, packages)) <= MOST_MB


@pytest.mark.slow
def test_no_package_of_a_run_or_an_extra_has_a_licence_of_which_the_guide_does_not_tell() -> None:
    guide = (ROOT / "docs" / "how-to" / "install.md").read_text(encoding="utf-8")
    text = table()
    rows = [line.split(" | ") for line in text.splitlines()[2:]]
    assert {row[0].strip("| ") for row in rows} >= {"`(none)`", "`dask`", "`r`", "`sql`", "`tdms`"}
    missing = [
        (row[0], one) for row in rows for one in row[3].rstrip(" |").split(", ") if one != "–" and one not in guide
    ]
    assert missing == []
    assert "AGPL" not in text
