"""``tumbleline archive query``: SQL queries on the archive."""

import csv
import io
from pathlib import Path
from typing import Annotated

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import cell, is_standard_output, print_json, print_table, print_text, publish, say

MANY = 100


def query(
    sql: Annotated[str, argument("SQL", "One SELECT, for instance 'SELECT count(*) FROM units'.")],
    output: Annotated[
        Path | None,
        option("--output -o FILE.csv", "Comma-separated values in this file, or with - on standard output."),
    ] = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
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

    printed = is_standard_output(output, "archive query", as_json=as_json)
    store = Archive(archive)
    store.refuse_misnamed(archive)
    answer = ask(store, sql, compact=compact)
    if output is not None:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(answer.columns)
        writer.writerows(answer.rows)
        print_text(text.getvalue()) if printed else publish(output, text.getvalue(), "answer")
    if as_json:
        print_json({"columns": list(answer.columns), "rows": answer.documents()})
    if as_json or output is not None:
        return
    print_table(
        list(answer.columns), [["" if value is None else cell(value) for value in row] for row in answer.rows[:MANY]]
    )
    if len(answer.rows) > MANY:
        say(f"{number_of(len(answer.rows) - MANY, 'more row')}; print all rows with --json or --output -")
