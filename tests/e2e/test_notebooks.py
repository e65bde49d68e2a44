"""The notebooks of the documents run, and their outputs are of the kind that stands in them."""

import json
from pathlib import Path
from typing import Any

import pytest

from docs import notebooks

FILES = sorted(notebooks.FOLDER.glob("*.ipynb"))


def kinds(notebook: dict[str, Any]) -> list[list[str]]:
    """The forms of output of every cell."""
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    return [[form for one in cell["outputs"] for form in one.get("data", {one["output_type"]: ""})] for cell in cells]


@pytest.mark.slow  # what they do with the package: tests/e2e/test_python.py
@pytest.mark.parametrize("path", FILES, ids=lambda one: one.stem)
def test_a_notebook_runs_and_shows_what_it_did(path: Path) -> None:
    assert len(FILES) == 3
    kept = json.loads(path.read_text(encoding="utf-8"))
    # it checks itself against its truth
    assert any("assert" in line for cell in kept["cells"] for line in cell["source"])
    assert kinds(notebooks.run(path)) == kinds(kept)
    assert "<svg" in path.read_text(encoding="utf-8")
    assert str(Path.home()) not in path.read_text(encoding="utf-8")
