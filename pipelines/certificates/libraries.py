"""Versions of the numerical libraries of the tables of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

REPORT = "report"  # only for display


def differing_libraries(run: str, manifests: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each library with more than one version among the tables of a run.

    Versions are not in the keys of stages (docs/decisions/re-runs.md), so after an update a run can have stages with
    different versions.

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
        f"run {run}: tables made with {library} {_versions_text(by)}; check the numbers with 'tumbleline rerun {run} --check'"
        for library, by in sorted(versions.items())
        if len(by) > 1
    ]


def _versions_text(by: Mapping[str, list[str]]) -> str:
    return " and ".join(f"{number} ({', '.join(names)})" for number, names in sorted(by.items()))
