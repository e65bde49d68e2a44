"""Versions: of Python and of the libraries, against the ranges that the product declares and against its lock."""

import platform
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from pipelines.doctor.documents import Check
from schemas.locks import UNUSED, pins
from schemas.shipped import PRODUCT, shipped

PART = "software"
LOCK = "requirements-run.lock"
SHOWN = 5
DEVELOPMENT = {"build", "dev", "bench", "docs"}  # extras of those who change the product, not of those who use it


def software_checks() -> list[Check]:
    """Python, the product, its libraries, the lock, and the optional libraries."""
    product = Check(PART, PRODUCT, "good", f"{metadata.version(PRODUCT)} in {Path(__file__).resolve().parents[2]}")
    return [_python(), product, *_libraries(), _pinned(), _optional()]


def _python() -> Check:
    version = platform.python_version()
    needed = metadata.metadata(PRODUCT)["Requires-Python"] or ""
    if version not in SpecifierSet(needed, prereleases=True):
        return Check(PART, "Python", "fault", version, needed, "install the product in an environment of that version")
    classes = metadata.metadata(PRODUCT).get_all("Classifier") or ()  # the versions that the tests have run on
    tested = [name.rpartition(" :: ")[2] for name in classes if name.startswith("Programming Language :: Python :: 3.")]
    if version.rpartition(".")[0] not in tested:
        remedy = "install the product in an environment of one of these where it is validated"
        needed = f"{', '.join(tested)}, which the tests run on"
        return Check(PART, "Python", "warning", f"{version}, not tested", needed, remedy)
    return Check(PART, "Python", "good", version)


def _libraries() -> list[Check]:
    """Libraries that are missing or outside the ranges of the product or of one another: a check each, the product's first."""
    checks: dict[str, Check] = {}
    needed = list(needed_below([(PRODUCT, frozenset())]))
    for by, requirement in needed:
        name, specifier = requirement.name, requirement.specifier
        remedy, version = f"run: pip install '{name}{specifier}'", _installed(name)
        if version is None:
            checks.setdefault(name, Check(PART, name, "fault", "not installed", f"{by} needs it", remedy))
        elif not specifier.contains(version, prereleases=True):
            state = "fault" if by == PRODUCT else "warning"
            checks.setdefault(name, Check(PART, name, state, version, f"{specifier} for {by}", remedy))
    return list(checks.values()) or [Check(PART, "libraries", "good", f"{len(needed)} requirements are met")]


def needed_below(begin: Iterable[tuple[str, frozenset[str]]]) -> Iterator[tuple[str, Requirement]]:
    """Requirements of distributions with some extras and, of what is installed, theirs; each with the one that declares it."""
    left = list(begin)
    seen: set[tuple[str, frozenset[str]]] = set()
    while left:
        name, extras = left.pop()
        if (name, extras) in seen or _installed(name) is None:
            continue
        seen.add((name, extras))
        for requirement in map(Requirement, metadata.requires(name) or ()):
            needed, marker = canonicalize_name(requirement.name), requirement.marker
            holds = marker is None or any(marker.evaluate({"extra": extra}) for extra in extras or {""})
            if holds and needed not in UNUSED.get(name, ()):
                yield name, requirement
                left.append((needed, frozenset(requirement.extras)))


def _pinned() -> Check:
    """Versions that are not those of the lock: they may work, but they are not tested."""
    path = shipped(LOCK)
    if path is None:
        remedy = "install the product from its wheel"
        return Check(PART, "lock", "not configured", f"{LOCK} is not installed", "", remedy)
    locked = {pin.name: pin.version for pin in pins(path.read_text(encoding="utf-8")) if pin.holds()}
    held: dict[str, str] = {
        canonicalize_name(distribution.name): distribution.version for distribution in metadata.distributions()
    }
    other = [
        f"{name} {held[name]}, not {version}"
        for name, version in sorted(locked.items())
        if name in held and held[name] != version
    ]
    if not other:
        matching = len(locked.keys() & held.keys())
        return Check(PART, "lock", "good", f"{matching} libraries have the versions of the lock")
    more = f" and {len(other) - SHOWN} more" if len(other) > SHOWN else ""
    found, needed = f"{'; '.join(other[:SHOWN])}{more}", "the versions of the lock, which were tested together"
    return Check(PART, "lock", "warning", found, needed, f"run: pip install --no-deps --require-hashes -r {path}")


def _optional() -> Check:
    """Extras whose libraries are installed, and those whose libraries are not: formats of recordings, certificates as PDF."""
    declared = [Requirement(require) for require in metadata.requires(PRODUCT) or ()]
    have: list[str] = []
    lack: list[str] = []
    for extra in sorted(set(metadata.metadata(PRODUCT).get_all("Provides-Extra") or ()) - DEVELOPMENT):
        requirements = [
            requirement
            for requirement in declared
            if requirement.marker is not None
            and not requirement.marker.evaluate({"extra": ""})
            and requirement.marker.evaluate({"extra": extra})
            and canonicalize_name(requirement.name) != PRODUCT
        ]
        if requirements:
            (have if all(_installed(requirement.name) for requirement in requirements) else lack).append(extra)
    if not have and not lack:
        remedy = "install the product again, so that its metadata are those of its code"
        return Check(PART, "optional parts", "warning", "the metadata name none", "the extras of this version", remedy)
    found = f"installed: {', '.join(have) or 'none'}; not installed: {', '.join(lack) or 'none'}"
    if not lack:
        return Check(PART, "optional parts", "good", found)
    remedy = f"where they are used, run: pip install '{PRODUCT}[{','.join(lack)}]'"
    return Check(PART, "optional parts", "not configured", found, "", remedy)


def _installed(name: str) -> str | None:
    """The version of a distribution; None where it is not installed."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
