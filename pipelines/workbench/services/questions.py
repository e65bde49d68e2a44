"""Questions to the archive in SQL: the same text is asked by the page and printed as its command."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipelines.workbench.state import UnitsPage

ROWS = 50
ORDERS = {
    "measured": "measured DESC, unit",
    "unit": "unit, measured DESC",
    "outcome": "outcome, unit",
    "station": "station, unit",
}


def quoted(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''").replace("\0", "") + "'"


def like(text: str) -> str:
    """A pattern that finds a text anywhere, its own signs taken as they are."""
    plain = text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
    return f"{quoted(f'%{plain}%')} ESCAPE '!'"


def conditions(page: UnitsPage) -> str:
    """What the page's fields choose."""
    parts: list[str] = []
    if page.search:
        found = like(page.search)
        parts.append(f"(unit ILIKE {found} OR run ILIKE {found})")
    for column in ("outcome", "station", "device"):
        if value := getattr(page, column):
            parts.append(f"{column} = {quoted(value)}")
    if page.since:
        parts.append(f"measured >= {quoted(page.since)}")
    if page.until:
        parts.append(f"measured < {quoted(page.until + 'T99')}")
    return " AND ".join(parts) or "true"


def units_question(page: UnitsPage) -> str:
    """A page of units with their runs."""
    start = (page.page - 1) * ROWS
    return (
        "SELECT unit, outcome, grade, slot, run, measured, station, device FROM units JOIN runs USING (run) "
        f"WHERE {conditions(page)} ORDER BY {ORDERS[page.order]} LIMIT {ROWS} OFFSET {start}"
    )


def yield_question(page: UnitsPage) -> str:
    """How many units came to what."""
    return (
        f"SELECT outcome, count(*) AS units FROM units JOIN runs USING (run) WHERE {conditions(page)} GROUP BY outcome"
    )


def history_question(unit: str) -> str:
    """The coefficients of a unit in all its runs."""
    return (
        "SELECT measured, run, effect, name, axis, value, standard_error, unit_text FROM coefficients JOIN runs USING (run) "
        f"WHERE unit = {quoted(unit)} AND rerun_of = '' ORDER BY measured, run"
    )
