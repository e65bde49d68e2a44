"""Pictures and tables as a notebook shows them."""

from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

if TYPE_CHECKING:
    from pipelines.drawing.chart import Chart


MOST_ROWS = 40  # rows of a table that is shown; the table itself has all


@dataclass(frozen=True)
class Picture:
    """A chart; a notebook shows it, and :meth:`save` writes it as ``.svg``, ``.png`` or ``.pdf``."""

    chart: "Chart"

    def _repr_svg_(self) -> str:
        from pipelines.drawing.vector import alone, svg_text

        return alone(svg_text(self.chart))

    def __repr__(self) -> str:
        return f"<Picture: {self.chart.title}>"

    def save(self, path: str | Path) -> Path:
        """Write the picture; the ending of the name says how.

        Raises
        ------
        WrongUse
            The ending is none of those that can be drawn.
        """
        from pipelines.archive import files
        from pipelines.drawing.picture import picture, refuse_ending

        target = Path(path)
        refuse_ending(target, "save")
        files.publish(target, picture(self.chart, target.suffix), "save", files.ELSEWHERE)
        return target


def rounded_table(rows: pd.DataFrame) -> pd.DataFrame:
    """Coefficients as a person reads them: value and U (k = 2) to the digits that U supports."""
    from inertial.uncertainty.rounding import rounded

    texts = [rounded(value, u) for value, u in zip(rows["value"], rows["U"], strict=True)]
    shown = rows.drop(columns=["value", "standard_error", "U", "unit_text"])
    return shown.assign(value=[v for v, _ in texts], U=[u for _, u in texts], unit_text=rows["unit_text"]).rename(
        columns={"unit_text": "in"}
    )


_SHORT: dict[str, Any] = {"max_rows": MOST_ROWS, "float_format": "{:.4g}".format}


def as_html(title: str, lines: list[str], *tables: pd.DataFrame, picture: Picture | None = None) -> str:
    """A heading, sentences and tables for a notebook."""
    parts = [f"<p><b>{escape(title)}</b></p>", *(f"<p>{escape(line)}</p>" for line in lines)]
    parts += [table.to_html(index=False, border=0, **_SHORT) for table in tables if len(table)]
    parts += [] if picture is None else [picture._repr_svg_()]
    return "".join(parts)


def as_text(title: str, lines: list[str], *tables: pd.DataFrame) -> str:
    """The picture as text."""
    return "\n".join([title, *lines, *(table.to_string(index=False, **_SHORT) for table in tables if len(table))])
