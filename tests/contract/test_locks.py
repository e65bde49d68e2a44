"""Each lock holds for each supported Python: resolved here by markers and metadata of what is installed, without a network.

``make locks-check`` resolves the rest with an index, and asks it for a wheel of everything.
"""

import re
import subprocess
import tomllib
from functools import cache
from importlib import metadata

import pytest
from each import each
from long_suites import mostly_slow
from packaging.markers import Marker
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from test_packaging import ROOT, text_of

from schemas.locks import PYTHONS, UNUSED, Pin, on_linux, pins

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
PATCHES = ("3.11.2", "3.11.7", *PYTHONS)
LOCKS = {path.stem.removeprefix("requirements-"): text_of(path) for path in ROOT.glob("requirements-*.lock")}


@cache
def extras_of_locks() -> dict[str, tuple[str, ...]]:
    """Extras that each lock is made with, as ``make locks`` would."""
    done = subprocess.run(["make", "--dry-run", "locks"], cwd=ROOT, capture_output=True, text=True, check=True)
    calls = r"^(\S+ pip compile.*--output-file requirements-(\w+)[.]lock.*)$"
    found = re.findall(calls, done.stdout.replace("\\\n", ""), re.MULTILINE)
    return {name: tuple(re.findall(r"--extra (\w+)", line)) for line, name in found}


@cache
def made_from(lock: str) -> tuple[str, ...]:
    """The requirements that a lock is made from."""
    if lock == "crate":
        return tuple(re.findall(r"^CRATE_NEEDS := (.*)$", MAKEFILE, re.MULTILINE))
    extras = PROJECT["optional-dependencies"]
    return (*PROJECT["dependencies"], *(line for extra in extras_of_locks()[lock] for line in extras[extra]))


@cache
def installed(name: str, version: str) -> list[str] | None:
    """What an installed library of this version needs; None where it is not here, or in another version."""
    try:
        held = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None
    return held.requires or [] if held.version == version else None


@cache
def parsed(line: str) -> Requirement:
    return Requirement(line)


@cache
def holds(marker: str, python: str, extra: str) -> bool:
    return Marker(marker).evaluate({**on_linux(python), "extra": extra})


@cache
def entries(lock: str) -> tuple[Pin, ...]:
    return tuple(pins(LOCKS[lock]))


def resolve(lock: str, python: str, lines: tuple[str, ...]) -> tuple[list[str], set[str], set[str]]:
    """What is wrong with a lock on a version of Python, what was reached, and of which of it the needs are not known here."""
    held = [pin for pin in entries(lock) if pin.marker is None or holds(str(pin.marker), python, "")]
    locked = {pin.name: pin for pin in held}
    wrong = [f"{pin.name}: twice" for pin in held if locked[pin.name] is not pin]
    left = [("the project", line, frozenset({""})) for line in lines]
    seen, unknown = set(), set()
    while left:
        by, line, extras = one = left.pop()
        requirement = parsed(line)
        if one in seen:
            continue
        seen.add(one)
        if requirement.marker and not any(holds(str(requirement.marker), python, extra) for extra in extras):
            continue
        name = canonicalize_name(requirement.name)
        if name == PROJECT["name"]:
            left += [(by, r, extras) for e in requirement.extras for r in PROJECT["optional-dependencies"][e]]
            continue
        pin = locked.get(name)
        if pin is None or not pin.hashes or not requirement.specifier.contains(pin.version, prereleases=True):
            wrong.append(f"{by} needs {requirement}, the lock has {pin and (pin.version, len(pin.hashes))}")
            continue
        needs = installed(name, pin.version)
        unknown |= {name} if needs is None else set()
        extras = frozenset({"", *requirement.extras})
        left += [
            (name, r, extras) for r in needs or () if canonicalize_name(parsed(r).name) not in UNUSED.get(name, ())
        ]
    return wrong, {canonicalize_name(parsed(line).name) for _, line, _ in seen}, unknown


@pytest.mark.parametrize("python", mostly_slow(PATCHES, *PATCHES[::5]))
@each(sorted(LOCKS))
def test_a_lock_holds_what_is_needed_on_each_python(lock: str, python: str) -> None:
    wrong, reached, unknown = resolve(lock, python, made_from(lock))
    assert wrong == []
    if lock in {"run", "all", "dev"}:  # libraries that the environment of the tests has
        elsewhere = {pin.name for pin in entries(lock) if pin.marker is not None and not pin.holds()}
        assert unknown <= elsewhere
        here = {pin.name for pin in entries(lock) if pin.marker is None or holds(str(pin.marker), python, "")}
        assert not here - reached or unknown, "the lock has what nothing needs"


@each(sorted(LOCKS))
def test_a_lock_has_a_version_and_hashes_for_everything_and_no_address(lock: str) -> None:
    text = LOCKS[lock]
    assert "://" not in text
    assert len(entries(lock)) == len(re.findall(r"^\S", text, re.MULTILINE)) > 20
    assert [pin.name for pin in entries(lock) if not pin.hashes] == []
    assert sum(len(pin.hashes) for pin in entries(lock)) == text.count("--hash=")


def test_a_library_has_one_version_in_every_lock_that_a_person_or_a_test_installs() -> None:
    versions: dict[tuple[str, str], set[str]] = {}
    for lock in ("run", "all", "dev", "bench"):
        for pin in entries(lock):
            for python in PYTHONS:
                if pin.marker is None or holds(str(pin.marker), python, ""):
                    versions.setdefault((pin.name, python), set()).add(pin.version)
    assert {name: found for name, found in versions.items() if len(found) > 1} == {}


def test_the_lock_for_users_has_every_extra_that_is_not_for_development() -> None:
    taken = set(extras_of_locks()["all"])
    for extra in taken & PROJECT["optional-dependencies"].keys():
        for line in PROJECT["optional-dependencies"][extra]:
            taken |= parsed(line).extras if parsed(line).name == PROJECT["name"] else set()
    assert set(PROJECT["optional-dependencies"]) - taken == {"dev", "bench", "docs"}
    # versions that are tested, accepted and locked agree
    assert SpecifierSet(PROJECT["requires-python"]).contains(f"{PYTHONS[0]}.0")
    assert not SpecifierSet(PROJECT["requires-python"]).contains("3.10.99")
    assert set(re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))) <= set(PYTHONS)


@each([(2, 7), (3, 10), (3, 15), *(tuple(map(int, p.split("."))) for p in PYTHONS)])
def test_make_refuses_another_python_in_one_line(version: tuple[int, int]) -> None:
    (check,) = re.findall(r"^SUPPORTED := (.*)$", MAKEFILE, re.MULTILINE)
    code = f"import sys; sys.version_info = {version!r}; " + check.removeprefix("import sys; ")
    done = subprocess.run(["python3", "-c", code], capture_output=True, text=True, check=False)
    accepted = ".".join(map(str, version)) in PYTHONS
    assert (done.returncode, done.stderr.count("\n")) == ((0, 0) if accepted else (1, 1))
    refusal = rf"Python {version[0]}\.{version[1]}.*{PYTHONS[0]} to {PYTHONS[-1]}"
    assert re.search(refusal, done.stderr) is None if accepted else re.search(refusal, done.stderr)
