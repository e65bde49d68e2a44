"""Questions to the archive in SQL: the page and its printed command use the same text."""

from __future__ import annotations

from typing import Protocol

ROWS = 50
ORDERS = {
    "measured": "measured DESC, unit",
    "unit": "unit, measured DESC",
    "outcome": "outcome, unit",
    "station": "station, unit",
}


class SearchPage(Protocol):
    """Criteria of the search; empty for any.

    since, until : days, ISO · order : a key of :data:`ORDERS`
    """

    @property
    def search(self) -> str: ...  # noqa: D102 - told above
    @property
    def outcome(self) -> str: ...  # noqa: D102
    @property
    def station(self) -> str: ...  # noqa: D102
    @property
    def device(self) -> str: ...  # noqa: D102
    @property
    def since(self) -> str: ...  # noqa: D102
    @property
    def until(self) -> str: ...  # noqa: D102
    @property
    def order(self) -> str: ...  # noqa: D102
    @property
    def page(self) -> int: ...  # noqa: D102


def quoted(text: str) -> str:
    """A text as a literal of SQL."""
    return "'" + text.replace("'", "''").replace("\0", "") + "'"


def like(text: str) -> str:
    """A pattern that finds a text anywhere, with its special characters escaped."""
    plain = text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
    return f"{quoted(f'%{plain}%')} ESCAPE '!'"


def conditions(page: SearchPage) -> str:
    """The conditions of the fields of the page."""
    parts: list[str] = []
    if page.search:
        pattern = like(page.search.lower())
        parts.append(f"(lower(unit) LIKE {pattern} OR lower(run) LIKE {pattern})")
    chosen = {column: getattr(page, column) for column in ("outcome", "station", "device")}
    parts += [f"{column} = {quoted(value)}" for column, value in chosen.items() if value]
    if page.since:
        parts.append(f"measured >= {quoted(page.since)}")
    if page.until:
        parts.append(f"measured < {quoted(page.until + 'T99')}")
    return " AND ".join(parts) or "true"


def units_question(page: SearchPage) -> str:
    """A page of units with their runs."""
    start = (page.page - 1) * ROWS
    return (
        "SELECT unit, outcome, grade, slot, run, measured, station, device "  # noqa: S608 - texts are quoted
        "FROM units JOIN runs USING (run) "
        f"WHERE {conditions(page)} ORDER BY {ORDERS[page.order]} LIMIT {ROWS} OFFSET {start}"
    )


def yield_question(page: SearchPage) -> str:
    """Number of units by outcome."""
    return (
        f"SELECT outcome, count(*) AS units FROM units JOIN runs USING (run) WHERE {conditions(page)} GROUP BY outcome"  # noqa: S608 - texts are quoted
    )


def newest_question(count: int) -> str:
    """The newest runs, and how many there are."""
    return f"SELECT run, count(*) OVER () AS runs FROM runs ORDER BY started DESC, run DESC LIMIT {count}"  # noqa: S608 - a number


def history_question(unit: str) -> str:
    """The coefficients of a unit in all its runs."""
    return (
        "SELECT measured, run, effect, name, axis, value, standard_error, unit_text "  # noqa: S608 - the serial is quoted
        "FROM coefficients JOIN runs USING (run) "
        f"WHERE unit = {quoted(unit)} AND rerun_of = '' ORDER BY measured, run"
    )
