"""Locks: the version and the hashes of each library, and the Pythons that an entry is for."""

import re
from collections.abc import Mapping
from typing import NamedTuple

from packaging.markers import Marker
from packaging.utils import canonicalize_name

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
"""The versions that the locks are for; later ones have no wheels of these libraries."""

UNUSED = {
    "allantools": frozenset({"matplotlib", "numpydoc", "pytest"}),  # plots, documents and tests of its own
    "prefect": frozenset({"apprise", "docker"}),  # blocks that notify chat services, and workers in containers
}
"""What a library asks for and imports only in parts of it that nothing here uses: the locks leave it out."""

_ENTRY = re.compile(r"([\w.-]+)(?:\[[^\]]*\])?==([^\s;\\]+)(?: *; *([^\\\n]+?))? *(?:\\?\n|$)")
_HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")


class Pin(NamedTuple):
    """One entry of a lock."""

    name: str
    """Normalised."""
    version: str
    marker: Marker | None
    """Where it is installed; None: everywhere."""
    hashes: tuple[str, ...]
    """SHA-256 of the files of this version, of all systems and Pythons."""

    def holds(self, environment: Mapping[str, str] | None = None) -> bool:
        """Whether the package is installed in an environment, given by the markers that differ from those of this Python."""
        return self.marker is None or self.marker.evaluate(dict(environment or {}))


def on_linux(python: str) -> dict[str, str]:
    """Markers of a version of CPython on Linux, as 3.13 or 3.11.2."""
    release = python if python.count(".") > 1 else f"{python}.0"
    return {
        "python_version": ".".join(release.split(".")[:2]),
        "python_full_version": release,
        "implementation_version": release,
        "implementation_name": "cpython",
        "platform_python_implementation": "CPython",
        "sys_platform": "linux",
        "platform_system": "Linux",
        "os_name": "posix",
    }


def pins(lock: str) -> list[Pin]:
    """The entries of the text of a lock."""
    found = [(entry, _ENTRY.match(entry)) for entry in re.split(r"\n(?=\S)", lock.strip())]
    return [
        Pin(canonicalize_name(m[1]), m[2], Marker(m[3]) if m[3] else None, tuple(_HASH.findall(entry)))
        for entry, m in found
        if m is not None
    ]
