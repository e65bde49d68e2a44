"""``tumbleline show``: a run, or one of its tables."""

from __future__ import annotations

from typing import Annotated

import typer

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import print_json, print_table, say, short
from pipelines.cli.validity import print_remarks, show_validity
from schemas.errors import DONE, PART_FAILED

PART = "Results"
ORDER = 320
SUMMARY = "Show a run, one of its tables, or the calibration of a unit that is valid on a date."
EXAMPLES = (
    "tumbleline show latest coefficients",
    "tumbleline show SN1 --at 2026-03-01",
)

MANY = 40


def command(
    run: Annotated[
        str, argument("RUN|UNIT", "Name of a run, the beginning of it, or 'latest'; or a serial number.")
    ] = "latest",
    table: Annotated[str, argument("[TABLE]", "A table of the run, for instance coefficients.")] = "",
    at: Annotated[str, option("--at DATE", "Show the calibration of UNIT that is valid on this day.")] = "",
    known: Annotated[str, option("--known DATE", "With --at: as the archive was on this day.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show the result of a run, one of its tables, or the calibration of a unit that is valid on a date (default: today).

    Exit status 1: no calibration of the unit is valid on that date.
    """
    store = Archive(archive)
    if at or known or _is_unit(store, run):
        raise typer.Exit(DONE if show_validity(store, run, at, known, as_json=as_json) else PART_FAILED)
    shown_run = store.run(run)
    if table:
        _show_table(shown_run, table, as_json=as_json)
    else:
        _show_run(shown_run, as_json=as_json)


def _is_unit(archive: Archive, name: str) -> bool:
    """Whether no run name begins so, and a unit with calibrations has this serial number."""
    from pipelines.certificates import Ledger

    if name == "latest" or any(run.startswith(name) for run in archive.run_ids()):
        return False
    return bool(Ledger(archive).events(name))


def _show_run(run: Run, *, as_json: bool) -> None:
    from pipelines.cli.summary import print_summary, summary

    tables = run.tables()
    print_remarks(run, [str(unit["serial"]) for unit in run.about.get("lot", {}).get("units", [])])
    document = {
        **(summary(run) if "grades" in tables else {"run": run.id, "units": []}),
        "tables": tables,
        "provenance": {key: run.about.get(key) for key in ("who", "where", "when", "libraries", "capture", "source")},
    }
    if as_json:
        print_json(document)
        return
    if document["units"]:
        print_summary(document)
    else:
        say(_unfinished(run))
    say(f"tables  {', '.join(tables)}")


def _unfinished(run: Run) -> str:
    """Why a run has no grades: it was imported, or it was stopped."""
    if run.records is None:
        return f"run {run.id} was imported: it has no grades"
    done = len(run.records.finished())
    return f"run {run.id} is not finished ({number_of(done, 'record')} stored); give its 'tumbleline run' again to continue"


def _show_table(run: Run, name: str, *, as_json: bool) -> None:
    from pipelines.tables.frames import rows_of

    frame = run.table(name)
    if as_json:
        print_json({"run": run.id, "table": name, "rows": rows_of(frame)})
        return
    shown = frame.head(MANY)
    lines = [[_cell(value) for value in row] for row in shown.itertuples(index=False)]
    print_table([str(column) for column in frame.columns], lines, title=f"{run.id}: {name}")
    if len(frame) > MANY:
        say(f"{number_of(len(frame) - MANY, 'more row')}; print all rows with --json")


def _cell(value: object) -> str:
    return short(value, 5) if isinstance(value, float) else str(value)
