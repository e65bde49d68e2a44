"""Keys of stages: a hash of inputs, parameters and code. They do not contain what has no effect on a result."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipelines.archive.code import CODE

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "pandera")


def digest(content: object) -> str:
    """Hash of a JSON-able value, independent of the order of its keys; hexadecimal."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def stage_key(stage: str, inputs: Mapping[str, str], parameters: Mapping[str, Any], code: str) -> str:
    """The key under which a stage's outputs are stored.

    inputs : hash of the content of every input table, by name.
    parameters : JSON-able values that the stage is called with.
    code : hash of the stage's code, from :func:`code_hash`.
    """
    return digest({"stage": stage, "inputs": dict(inputs), "parameters": dict(parameters), "code": code})


@cache
def code_hash(result: str) -> str:
    """Hash of the sources of the modules that :data:`~pipelines.archive.code.CODE` declares for a stored result."""
    total = hashlib.sha256()
    for name, path in sources(CODE[result]).items():
        total.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


@cache
def libraries() -> dict[str, str]:
    """Versions of the libraries that a number may depend on."""
    # with the parser of mail that it imports, a tenth of the time of a short command
    from importlib.metadata import version

    return {name: version(name) for name in LIBRARIES}


EXTENDED = {"inertial.effects": "tumbleline.effects"}  # packages to which others add modules under an entry point


def sources(modules: Iterable[str]) -> dict[str, Path]:
    """Files of modules, and of everything below those that are packages, by name; nothing is imported for it.

    Raises LookupError: there is no such module
    """
    found: dict[str, Path] = {}
    for module in modules:
        top, *parts = module.split(".")
        spec = find_spec(top)
        path = Path(spec.origin).parent.joinpath(*parts) if spec is not None and spec.origin else Path(module)
        if path.is_dir():
            for each in path.rglob("*.py"):
                below = each.relative_to(path).with_suffix("").parts
                found[".".join((module, *(part for part in below if part != "__init__")))] = each
        elif path.with_suffix(".py").is_file():
            found[module] = path.with_suffix(".py")
        else:
            raise LookupError(f"no module {module}")
        if module in EXTENDED:
            found |= _added(EXTENDED[module])
    return dict(sorted(found.items()))


def _added(group: str) -> dict[str, Path]:
    """Sources of the modules that other packages add under an entry point."""
    from importlib.metadata import entry_points  # see libraries()

    specs = {point.module: find_spec(point.module) for point in entry_points(group=group)}
    return {name: Path(spec.origin) for name, spec in specs.items() if spec is not None and spec.origin is not None}
