"""``python -m docs.figures_page``: the reference of figures of merit, from their modules; ``--check`` only compares."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from docs.generated_page import write_or_check
from pipelines.stages import figures
from pipelines.stages.figures import FigureKind

PAGE = Path(__file__).resolve().parent / "reference" / "figures.md"
EMPTY: Any = SimpleNamespace(static_record_s=0.0, verification=[], effects=[])
HEAD = """\
# Figures of merit

Written by `python -m docs.figures_page` from `pipelines/stages/figures/`; change its entry there, not this page. The names are
the keys of `[figures]` in limits files and the column `figure` of the table `figures`. A limits file states the unit again:
`bias_error_ug = { max = 100.0, unit = "µg" }`.

| figure | unit | meaning | the recipe needs |
|---|---|---|---|
"""


def page() -> str:
    """The whole page as Markdown."""
    return HEAD + "".join(f"{_row(kind)}\n" for kind in figures.FIGURES.values())


def _row(kind: FigureKind) -> str:
    meaning = kind.meaning.replace("|", "\\|")  # the magnitude |a|, in a table
    return f"| `{kind.name}` | {kind.unit} | {meaning} | {kind.missing(EMPTY)} |"


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(), "docs.figures_page"))
