"""The software bill of materials of a release: CycloneDX 1.6 in JSON, made from a lock and the metadata of what is installed.

``python -m deploy.sbom`` writes it to standard output. Names and versions are the lock's. Licences and the graph of dependencies
are those of the installed distributions of the same version; a library that is not installed in that version has neither.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
import uuid
from datetime import UTC, datetime
from importlib import metadata
from os import environ
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "requirements-run.lock"
PIN = re.compile(r"^([\w.-]+)(?:\[[\w, -]+\])?==([^\s;\\]+)")
HASH = re.compile(r"--hash=sha256:([0-9a-f]{64})")
SPACE = uuid.UUID("6f1c1d5e-0f0c-5d4e-9b65-0d6f1f3b7a10")


def pins(lock: str) -> dict[str, tuple[str, list[str]]]:
    """Version and SHA-256 of the files of each library of a lock, by its normalised name."""
    by_name: dict[str, tuple[str, list[str]]] = {}
    for entry in re.split(r"\n(?=\S)", lock.strip()):
        pin = PIN.match(entry)
        if pin is not None:
            by_name[canonicalize_name(pin[1])] = (pin[2], HASH.findall(entry))
    return by_name


def bill(lock: str, project: dict[str, Any], when: datetime, hashes: dict[str, str] | None = None) -> dict[str, Any]:
    """The bill of materials.

    Parameters
    ----------
    lock : text of the lock
    project : the table ``project`` of pyproject.toml
    when : time of the release
    hashes : SHA-256 of the files of the release, by name
    """
    locked = pins(lock)
    name, version = project["name"], project["version"]
    own = {
        "type": "application",
        "bom-ref": _reference(name, version),
        "name": name,
        "version": version,
        "description": project["description"],
        "licenses": [{"license": {"id": project["license"]}}],
        "purl": _reference(name, version),
        "properties": [
            {"name": "tumbleline:release:sha256", "value": f"{value}  {file}"} for file, value in (hashes or {}).items()
        ],
    }
    direct = [_reference(lib, locked[lib][0]) for lib in sorted(_needed(project["dependencies"])) if lib in locked]
    content = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(SPACE, lock + version)}",
        "version": 1,
        "metadata": {
            "timestamp": when.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
            "component": own,
        },
        "components": [_component(lib, pin, sums) for lib, (pin, sums) in sorted(locked.items())],
        "dependencies": [
            {"ref": own["bom-ref"], "dependsOn": direct},
            *({"ref": _reference(lib, locked[lib][0]), "dependsOn": _below(lib, locked)} for lib in sorted(locked)),
        ],
    }
    json.dumps(content, allow_nan=False)
    return content


def _component(name: str, version: str, sums: list[str]) -> dict[str, Any]:
    """A library; the hashes of the lock are those of its files for several systems, so they are properties."""
    licence = _licence(name, version)
    return {
        "type": "library",
        "bom-ref": _reference(name, version),
        "name": name,
        "version": version,
        "scope": "required",
        **({"licenses": [licence]} if licence else {}),
        "purl": _reference(name, version),
        "properties": [{"name": "tumbleline:lock:sha256", "value": one} for one in sums],
    }


def _licence(name: str, version: str) -> dict[str, Any]:
    """The licence of a library, where it is installed in that version."""
    installed = _installed(name, version)
    return {} if installed is None else licence_of(installed)


def licence_of(installed: Any) -> dict[str, Any]:
    """The licence that the metadata of a package state: an SPDX expression, else a name; empty where there is none."""
    if installed.get("License-Expression"):
        return {"expression": installed["License-Expression"]}
    stated = (installed.get("License") or "").strip()
    classes = [c.rpartition(" :: ")[2] for c in installed.get_all("Classifier") or () if c.startswith("License ::")]
    first = stated.partition("\n")[0].strip()
    short = stated == first and len(stated) <= 80
    text = stated if stated and short else ", ".join(classes) or first[:80]  # some hold the whole text
    return {"license": {"name": text}} if text else {}


def _below(name: str, locked: dict[str, tuple[str, list[str]]]) -> list[str]:
    """References of the libraries of the lock that an installed library needs, without its extras."""
    held = _installed(name, locked[name][0])
    needed = _needed(held.get_all("Requires-Dist") or ()) if held is not None else set()
    return [_reference(lib, locked[lib][0]) for lib in sorted(needed) if lib in locked]


def _needed(requirements: Any) -> set[str]:
    """Normalised names of the requirements that hold on this Python, without extras."""
    parsed = [Requirement(one) for one in requirements]
    return {canonicalize_name(r.name) for r in parsed if r.marker is None or r.marker.evaluate({"extra": ""})}


def _installed(name: str, version: str) -> Any:
    try:
        held = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None
    return held.metadata if held.version == version else None


def _reference(name: str, version: str) -> str:
    return f"pkg:pypi/{canonicalize_name(name)}@{version}"


def release_time() -> datetime:
    """The time in SOURCE_DATE_EPOCH, else now: with it a release can be built again to the same bytes."""
    given = environ.get("SOURCE_DATE_EPOCH")
    return datetime.fromtimestamp(int(given), UTC) if given else datetime.now(UTC)


def project_of(root: Path) -> dict[str, Any]:
    """The table ``project`` of pyproject.toml."""
    return tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]


if __name__ == "__main__":
    content = bill(LOCK.read_text(encoding="utf-8"), project_of(ROOT), release_time())
    sys.stdout.write(json.dumps(content, indent=1, ensure_ascii=False) + "\n")
