"""Keys of stages: a hash of inputs, parameters and code. They do not contain what has no effect on a result."""

from __future__ import annotations

import ast
import hashlib
import json
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "pandera")


def digest(content: object) -> str:
    """Hash of a JSON-able value, independent of the order of its keys; hexadecimal."""
    text = json.dumps(content, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def stage_key(stage: str, inputs: Mapping[str, str], parameters: Mapping[str, Any], code: str) -> str:
    """The key under which a stage's outputs are stored.

    Parameters
    ----------
    inputs : hash of the content of every input table, by name.
    parameters : JSON-able values that the stage is called with.
    code : hash of the stage's code, from :func:`code_hash`.
    """
    return digest(
        {
            "stage": stage,
            "inputs": dict(inputs),
            "parameters": dict(parameters),
            "code": code,
        }
    )


@cache
def code_hash(modules: Sequence[str]) -> str:
    """Hash of the sources that modules run: their own, those of everything below packages, and what they import.

    Parameters
    ----------
    modules : import names, as a tuple.
    """
    total = hashlib.sha256()
    for name, path in sources(modules).items():
        total.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return total.hexdigest()


@cache
def libraries() -> dict[str, str]:
    """Versions of the libraries that a number may depend on."""
    from importlib.metadata import (
        version,
    )  # with the parser of mail that it imports, a tenth of the time of a short command

    return {name: version(name) for name in LIBRARIES}


OWN = ("inertial", "schemas", "stations", "pipelines")

DISCOVERED = {"inertial.effects": "tumbleline.effects", "pipelines.stages.figures": ""}
"""Packages whose modules are discovered, with the entry points of extensions, if any."""


def sources(modules: Sequence[str]) -> dict[str, Path]:
    """Files by name: those of modules, of everything below packages, and of all that they import from the product.

    Parameters
    ----------
    modules : import names
    """
    left = [name for module in modules for name in _with_below(module)]
    sources: dict[str, Path] = {}
    while left:
        module = left.pop()
        path = _file(module)
        if module in sources or path is None:
            continue
        sources[module] = path
        left += _imports(module, path)
        if module in DISCOVERED:
            left += _with_below(module)
            sources |= _added(DISCOVERED[module]) if DISCOVERED[module] else {}
    return dict(sorted(sources.items()))


def _with_below(module: str) -> list[str]:
    """A module and, where it is a package, everything below it."""
    path = _file(module)
    if path is None or path.name != "__init__.py":
        return [module]
    folder = path.parent
    below = (p.relative_to(folder).with_suffix("").parts for p in folder.rglob("*.py"))
    return [module, *(".".join((module, *(part for part in parts if part != "__init__"))) for parts in below)]


@cache
def _file(module: str) -> Path | None:
    """The source of a module of the product; None for what is none, such as the name of something inside a module.

    The name is followed through the folders: :func:`importlib.util.find_spec` would import the modules above it.
    """
    top, *parts = module.split(".")
    spec = find_spec(top) if top in OWN else None
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent
    for part in parts[:-1]:
        folder /= part
    if not parts:
        return folder / "__init__.py"
    places = folder / parts[-1] / "__init__.py", folder / f"{parts[-1]}.py"
    return next((place for place in places if place.is_file()), None)


@cache
def _imports(module: str, path: Path) -> list[str]:
    """Names that a module imports, with the packages they lie in; a name inside a module is dropped later."""
    sources: set[str] = set()
    for node in _running(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            sources.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            sources.update({node.module, *(f"{node.module}.{alias.name}" for alias in node.names)})
    parents = {name.rsplit(".", depth)[0] for name in {*sources, module} for depth in range(1, name.count(".") + 1)}
    return sorted(name for name in sources | parents if name.split(".", 1)[0] in OWN)


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes of a source that run, blocks for type checkers left out."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            continue
        yield node
        yield from _running(node)


def _added(group: str) -> dict[str, Path]:
    """Sources of the modules that other packages add under an entry point."""
    from importlib.metadata import entry_points  # see libraries()

    specs = {point.module: find_spec(point.module) for point in entry_points(group=group)}
    return {name: Path(spec.origin) for name, spec in specs.items() if spec is not None and spec.origin is not None}
