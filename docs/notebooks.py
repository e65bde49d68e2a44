"""``python -m docs.notebooks``: run every notebook of ``docs/notebooks`` and keep its outputs in it; ``--check``: run only.

A notebook is run as a person would, cell by cell, in a folder of its own. What the last line of a cell gives is shown by
``_repr_svg_``, ``_repr_html_`` or as text.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parent / "notebooks"
FORMS = (("image/svg+xml", "_repr_svg_"), ("text/html", "_repr_html_"))


def run(path: Path) -> dict[str, Any]:
    """The notebook with the outputs of its cells; an error of a cell is raised with the cell's text."""
    notebook = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    count, before = 0, Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for cell in notebook["cells"]:
                if cell["cell_type"] == "code":
                    count += 1
                    cell["execution_count"] = count
                    cell["outputs"] = _outputs("".join(cell["source"]), names, f"{path.name}, cell {count}", count)
        finally:
            os.chdir(before)
    return notebook


def _outputs(text: str, names: dict[str, Any], where: str, count: int) -> list[dict[str, Any]]:
    tree = ast.parse(text, where)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, where, "exec"), names)  # noqa: S102 - a notebook of this repository
        value = None if last is None else eval(compile(ast.Expression(last.value), where, "eval"), names)  # noqa: S307
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        outputs.append({"output_type": "stream", "name": "stdout", "text": _lines(printed.getvalue())})
    if value is not None:
        data = {form: _lines(getattr(value, method)()) for form, method in FORMS if hasattr(value, method)}
        text = value if isinstance(value, str) else str(value)
        data["text/plain"] = _lines(repr(text) if isinstance(value, str) else text)
        outputs.append({"output_type": "execute_result", "metadata": {}, "execution_count": count, "data": data})
    return outputs


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def main() -> int:
    """Run the notebooks."""
    for path in sorted(FOLDER.glob("*.ipynb")):
        notebook = run(path)
        if "--check" not in sys.argv[1:]:
            path.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        sys.stdout.write(f"{path.name}: {sum(cell['cell_type'] == 'code' for cell in notebook['cells'])} cells\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
