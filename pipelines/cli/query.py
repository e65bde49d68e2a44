"""``tumbleline query``: SQL queries on the archive."""

import csv
import sys
from typing import Annotated

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import cell, print_json, print_table, say
from schemas.errors import WrongUse

PART = "Results"
ORDER = 350
SUMMARY = "Query the archive in SQL."
EXAMPLES = (
    "tumbleline query 'SELECT station, count(*) AS runs FROM runs GROUP BY station'",
    "tumbleline query 'SELECT * FROM units' --csv",
)

MANY = 100


def command(
    sql: Annotated[str, argument("SQL", "One SELECT, for instance 'SELECT count(*) FROM units'.")],
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
    as_csv: Annotated[bool, option("--csv", "Print comma-separated values and nothing else.")] = False,
    compact: Annotated[
        bool,
        option("--index/--no-index", "Read coefficients and figures from the index, or from the files of every run."),
    ] = True,
) -> None:
    """Query the archive in SQL: DuckDB on its Parquet files, read only.

    Views: runs, units, parameters, station, coefficients, figures, calibrations, and every table of the runs (dwells, residuals,
    grades, verification, noise, …) with the run in the first column.
    """
    from pipelines.audit.sql import ask

    if as_json and as_csv:
        raise WrongUse("query: --json and --csv are both given, one is needed; leave one out")
    answer = ask(Archive(archive), sql, compact=compact)
    if as_json:
        rows = [dict(zip(answer.columns, row, strict=True)) for row in answer.rows]
        print_json({"columns": list(answer.columns), "rows": rows})
        return
    if as_csv:
        writer = csv.writer(sys.stdout, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
        return
    print_table(
        list(answer.columns), [["" if value is None else cell(value) for value in row] for row in answer.rows[:MANY]]
    )
    if len(answer.rows) > MANY:
        say(f"{number_of(len(answer.rows) - MANY, 'more row')}; print all rows with --json or --csv")
