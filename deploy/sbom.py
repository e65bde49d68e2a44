"""The software bill of materials of a release: CycloneDX 1.6 in JSON, made from a lock and the metadata of what is installed.

``python -m deploy.sbom`` writes it to standard output. Names and versions are the lock's. Licences and the graph of dependencies
are those of the installed distributions of the same version; a library that is not installed in that version has neither.
"""

import json
import sys
import tomllib
import uuid
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib import metadata
from os import environ
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from schemas.locks import PYTHONS, Pin, on_linux, pins

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "requirements-run.lock"
SPACE = uuid.UUID("6f1c1d5e-0f0c-5d4e-9b65-0d6f1f3b7a10")


def bill(lock: str, project: dict[str, Any], when: datetime, hashes: dict[str, str] | None = None) -> dict[str, Any]:
    """The bill of materials; ``hashes`` has the SHA-256 of the files of the release by name."""
    locked: dict[str, list[Pin]] = {}
    for pin in pins(lock):
        locked.setdefault(pin.name, []).append(pin)
    name, version = project["name"], project["version"]
    component = {
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
    listed = [pin for _, same in sorted(locked.items()) for pin in same]
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(SPACE, lock + version)}",
        "version": 1,
        "metadata": {
            "timestamp": when.astimezone(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
            "component": component,
        },
        "components": [_component(pin) for pin in listed],
        "dependencies": [
            {"ref": component["bom-ref"], "dependsOn": _references(project["dependencies"], locked)},
            *({"ref": _reference(pin.name, pin.version), "dependsOn": _below(pin, locked)} for pin in listed),
        ],
    }


def _component(pin: Pin) -> dict[str, Any]:
    """A library; the hashes of the lock are those of its files for several systems, so they are properties.

    What the lock installs on some Pythons or systems only is optional, with the marker that says where.
    """
    held = _metadata_of(pin)
    licence = {} if held is None else licence_of(held)
    where = [{"name": "tumbleline:lock:marker", "value": str(pin.marker)}] if pin.marker else []
    return {
        "type": "library",
        "bom-ref": _reference(pin.name, pin.version),
        "name": pin.name,
        "version": pin.version,
        "scope": "optional" if pin.marker else "required",
        **({"licenses": [licence]} if licence else {}),
        "purl": _reference(pin.name, pin.version),
        "properties": [*where, *({"name": "tumbleline:lock:sha256", "value": value} for value in pin.hashes)],
    }


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


def _below(pin: Pin, locked: dict[str, list[Pin]]) -> list[str]:
    """References of the libraries of the lock that an installed library needs, without its extras."""
    held = _metadata_of(pin)
    return _references(held.get_all("Requires-Dist") or (), locked) if held is not None else []


def _references(requirements: Iterable[str], locked: dict[str, list[Pin]]) -> list[str]:
    """References of the requirements that hold on any Python of the locks: the bill is that of all of them."""
    parsed = [Requirement(text) for text in requirements]
    environments = [{**on_linux(python), "extra": ""} for python in PYTHONS]
    needed = {
        canonicalize_name(r.name) for r in parsed if r.marker is None or any(map(r.marker.evaluate, environments))
    }
    return [_reference(pin.name, pin.version) for lib in sorted(needed) for pin in locked.get(lib, ())]


def installed(name: str) -> metadata.Distribution | None:
    """A package that is installed."""
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def _metadata_of(pin: Pin) -> Any:
    """The metadata of a library, where it is installed in that version."""
    held = installed(pin.name)
    return held.metadata if held is not None and held.version == pin.version else None


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
