"""``python -m deploy.weight``: packages, megabytes and unusual licences of the product and of each of its extras.

What is measured is what is installed in the present environment: the files that the metadata of each package list, with the
compiled modules among them. Extras that are not installed whole are left out.
"""

import re
import sys
from collections.abc import Iterable
from functools import cache
from importlib.util import cache_from_source
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from deploy.sbom import ROOT, installed, licence_of, project_of
from pipelines.doctor.software import needed_below

NOT_OF_USERS = {"build", "dev", "bench", "docs"}
TESTS = frozenset({"test", "tests"})
KINDS = {
    "AGPL": ("AGPL", "Affero"),
    "LGPL": ("LGPL", "Lesser General"),
    "GPL": ("GPL", "General Public"),
    "MPL": ("MPL", "Mozilla"),
    "EPL": ("EPL", "Eclipse"),
}
"""Kinds of licences that ask more of who passes a program on than its notice, by what their names contain."""


class Weight(NamedTuple):
    """The installation of one part of the product: packages, their size without compiled modules of their tests, and licences."""

    part: str
    packages: tuple[str, ...]
    megabytes: float
    unusual: dict[str, str]


def weights() -> list[Weight]:
    """The product first, then each extra that is installed whole: what it adds."""
    project = project_of(ROOT)
    base = closure(project["dependencies"])
    parts = [_weight("(none)", base)]
    for extra, requirements in sorted(project["optional-dependencies"].items()):
        if extra in NOT_OF_USERS:
            continue
        added = closure(_flat(requirements, project["optional-dependencies"])) - base
        if all(installed(name) is not None for name in added):
            parts.append(_weight(extra, added))
    return parts


def closure(requirements: Iterable[str]) -> set[str]:
    """Normalised names of all packages that some requirements bring, on this Python; those that are missing are among them."""
    parsed = [Requirement(text) for text in requirements]
    below = needed_below((canonicalize_name(requirement.name), frozenset(requirement.extras)) for requirement in parsed)
    return {canonicalize_name(needed.name) for needed in (*parsed, *(requirement for _, requirement in below))}


def kind_of(licence: str) -> str:
    """The kind of an unusual licence; empty for a licence that asks for its notice only, and for a choice that includes one."""
    both = re.split(r" AND ", licence)  # each part holds; names after a comma are a choice, as OR is
    kinds = [[_kind(name) for name in re.split(r"\bOR\b|, ", part)] for part in both]
    return next((choice[0] for choice in kinds if all(choice)), "")


def _kind(name: str) -> str:
    return next((kind for kind, words in KINDS.items() if any(word.lower() in name.lower() for word in words)), "")


def _weight(part: str, packages: set[str]) -> Weight:
    licences = {name: text for name in sorted(packages) if kind_of(text := _licence(name))}
    return Weight(part, tuple(sorted(packages)), sum(map(megabytes, packages)), licences)


@cache
def megabytes(name: str) -> float:
    """Size of the installed files of a package and of its compiled modules, those of its tests left out, 10⁶ bytes."""
    held = installed(name)
    total = 0
    for file in (held.files or ()) if held is not None else ():
        path = Path(str(file.locate()))
        if path.suffix == ".pyc" or not path.is_file():
            continue  # a compiled module is listed only if it was compiled by the installer
        total += path.stat().st_size
        compiled = Path(cache_from_source(str(path))) if path.suffix == ".py" and not TESTS & set(path.parts) else path
        total += compiled.stat().st_size if compiled != path and compiled.is_file() else 0
    return total / 1e6


def _licence(name: str) -> str:
    held = installed(name)
    found = licence_of(held.metadata) if held is not None else {}
    return str(found.get("expression") or found.get("license", {}).get("name", ""))


def _flat(requirements: Iterable[str], extras: dict[str, list[str]]) -> list[str]:
    """The requirements of an extra, with those of the extras of this product that it names."""
    flat: list[str] = []
    for text in requirements:
        requirement = Requirement(text)
        flat += (
            [deep for extra in requirement.extras for deep in _flat(extras[extra], extras)]
            if requirement.name == "tumbleline"
            else [text]
        )
    return flat


def table() -> str:
    """The weights as a table of a document."""
    rows = ["| extra | packages | MB | licences that ask for more than their notice |", "|---|---|---|---|"]
    for weight in weights():
        by_licence = ", ".join(f"{name}: {licence}" for name, licence in weight.unusual.items()) or "–"
        rows.append(f"| `{weight.part}` | {len(weight.packages)} | {weight.megabytes:.0f} | {by_licence} |")
    return "\n".join(rows)


if __name__ == "__main__":
    sys.stdout.write(table() + "\n")
