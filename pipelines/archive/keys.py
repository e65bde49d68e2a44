"""Keys of stages: a hash of inputs, parameters and code. What varies without changing a result is not in them."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from pipelines.archive.sources import sources

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    return {name: version(name) for name in LIBRARIES}
