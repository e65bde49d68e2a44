"""A package of modules that a test writes, to be discovered like one of the product."""

from pathlib import Path

import pytest


def made_package(folder: Path, patch: pytest.MonkeyPatch, **modules: str) -> tuple[str, list[str]]:
    """Name and path of a package with these modules, importable as long as the patch."""
    name = f"of_{abs(hash((str(folder), *modules.items())))}"
    (folder / name).mkdir()
    for module, text in {"__init__": "", **modules}.items():
        (folder / name / f"{module}.py").write_text(text, encoding="utf-8")
    patch.syspath_prepend(folder)
    return name, [str(folder / name)]
