"""Versions of libraries that can move a number: which ones a run's tables were made with."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

REPORT = "report"  # shows numbers and makes none


def differing_libraries(run: str, manifests: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each library of which a run's tables were made with more than one version.

    Versions are not in the keys of stages (docs/decisions/re-runs.md), so a stage that is run again after an update stands beside
    stages of the version before.

    Parameters
    ----------
    manifests : of the run's tables, by table.
    """
    versions: dict[str, dict[str, list[str]]] = {}
    for name, content in sorted(manifests.items()):
        libraries = content.get("libraries")
        if name != REPORT and isinstance(libraries, dict):
            for library, number in libraries.items():
                versions.setdefault(str(library), {}).setdefault(str(number), []).append(name)
    return [
        f"run {run}: tables made with {library} {_told(by)}; 'tumbleline rerun {run} --check' tells whether a number moved"
        for library, by in sorted(versions.items())
        if len(by) > 1
    ]


def _told(by: Mapping[str, list[str]]) -> str:
    return " and ".join(f"{number} ({', '.join(names)})" for number, names in sorted(by.items()))
