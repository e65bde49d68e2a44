"""``tumbleline show``: a run, one of its tables, or the calibration of a unit on a date, from a few small files without numpy."""

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer

from inertial.counts import number_of
from pipelines.archive import Archive, Run
from pipelines.archive.run import lost_files, names_in
from pipelines.certificates import Calibration, Ledger
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import cell, conclude, error_console, give, print_json, print_table, remark, say
from schemas.errors import DONE, PART_FAILED, ArchiveUnusable, WrongUse

PART = "Results"
ORDER = 320
SUMMARY = "Show a run, one of its tables, its report, or the valid calibration of a unit."
EXAMPLES = ("tumbleline show latest coefficients", "tumbleline show SN1 --at 2026-03-01")

MANY = 40
NOTES = {
    "coefficients": (
        "standard_error: k = 1, of the value about which slow noise moves the coefficient; u of the bias as the mean over this "
        "measurement: bias_record_u_ug of the table wander"
    )
}
"""Meaning of the columns of a table whose names alone mislead."""


def command(
    run: Annotated[
        str, argument("RUN|UNIT", "Name of a run, the beginning of it, or 'latest'; or a serial number.")
    ] = "latest",
    table: Annotated[str, argument("[TABLE]", "A table of the run, for instance coefficients.")] = "",
    at: Annotated[str, option("--at DATE", "Show the calibration of UNIT that is valid on this day.")] = "",
    known: Annotated[str, option("--known DATE", "With --at: as the archive was on this day.")] = "",
    archive: ArchiveOption = None,
    *,
    report: Annotated[
        bool, option("--report", "Print the path of the run's report; made if it is missing or older than the tables.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the result of a run, one of its tables, or the calibration of a unit that is valid on a date (default: today).

    Exit status 1: no calibration of the unit is valid on that date, or a table of the result has changed since it was written.
    """
    store = Archive(archive)
    if at or known or (not report and _is_unit(store, run)):
        raise typer.Exit(DONE if show_validity(store, run, at, known, as_json=as_json) else PART_FAILED)
    shown_run = store.run(run, or_unit=True)
    if report:
        from pipelines.report import make_report

        with error_console().status("drawing the report"):
            make_report(shown_run)
        path = str(shown_run.report)
        give({"run": shown_run.id, "report": path}, lambda _: typer.echo(path), as_json=as_json)
    elif table:
        _show_table(shown_run, table, as_json=as_json)
    else:
        _show_run(shown_run, as_json=as_json)


def _is_unit(archive: Archive, name: str) -> bool:
    """Whether no run name begins so, and a unit with calibrations has this serial number."""
    if name == "latest" or any(run.startswith(name) for run in archive.run_ids()):
        return False
    return bool(Ledger(archive).events(name))


def _show_run(run: Run, *, as_json: bool) -> None:
    from pipelines.certificates.coefficient_remarks import changed_tables
    from pipelines.cli.summary import print_summary, summary

    _refuse_lost(run, lost_files(run.path, names_in(run.path)))
    tables = run.tables()
    print_remarks(run, [str(unit["serial"]) for unit in run.about.get("lot", {}).get("units", [])])
    document = {
        **(summary(run) if "grades" in tables else {"run": run.id, "units": []}),
        "tables": tables,
        "provenance": {key: run.about.get(key) for key in ("who", "where", "when", "libraries", "capture", "source")},
    }

    def show(_: object) -> None:
        if document["units"]:
            print_summary(document)
        elif run.records is None:
            say(f"run {run.id} was imported: it has no grades")
        else:
            stored = number_of(len(run.records.finished()), "record")
            say(f"run {run.id} is not finished ({stored} stored); give its 'tumbleline run' again to continue")
        say(f"tables  {', '.join(tables)}")

    changed = changed_tables(run)
    for name in changed:
        remark(
            f"show: {run.path / name}.parquet has changed since it was written (its hash is not its manifest's); what is "
            f"shown is of the grades and figures as they were decided. Restore it from a copy, see 'tumbleline verify {run.id}'"
        )
    conclude(document, show, as_json=as_json, passed=not changed)


def _refuse_lost(run: Run, lost: Sequence[str]) -> None:
    """Refuse to show what a finished run has lost: it would look as if it had not been finished."""
    if lost:
        raise ArchiveUnusable(
            f"show: run {run.id} is finished, and {', '.join(lost)} of it {'is' if len(lost) == 1 else 'are'} not there; restore "
            f"from a copy, see 'tumbleline verify {run.id}'"
        )


def _show_table(run: Run, name: str, *, as_json: bool) -> None:
    from pipelines.tables.frames import rows_of

    _refuse_lost(run, [file for file in lost_files(run.path, names_in(run.path)) if file.startswith(f"{name}.")])
    frame = run.table(name)
    if as_json:
        print_json({"run": run.id, "table": name, "rows": rows_of(frame)})
        return
    shown = frame.head(MANY)
    lines = [[cell(value) for value in row] for row in shown.itertuples(index=False)]
    print_table([str(column) for column in frame.columns], lines, title=f"{run.id}: {name}")
    if len(frame) > MANY:
        say(f"{number_of(len(frame) - MANY, 'more row')}; print all rows with --json")
    if name in NOTES and "wander" in run.tables():
        say(NOTES[name], style="dim")


MADE = ("stage", "code", "key", "libraries", "schema", "inputs", "parameters", "who", "where", "when")


def print_remarks(run: Run, serials: Sequence[str]) -> None:
    """Print missing or foreign signatures and differing library versions on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks, signature_remarks

    for line in (*signature_remarks(run, serials), *library_remarks(run)):
        remark(f"show: {line}")


def show_validity(archive: Archive, serial: str, at: str, known: str, *, as_json: bool) -> bool:
    """Print the calibration that is valid on a day; return whether there is one."""
    from pipelines.certificates.days import day_of, today
    from pipelines.certificates.entries import STATIC

    day = day_of(at, "--at") if at else today()
    history = Ledger(archive).calibrations(serial, day_of(known, "--known") if known else "")
    if not history:
        hint = archive.units_like(serial) or "certify one with 'tumbleline certificate issue'"
        raise WrongUse(f"show: unit {serial!r} has no calibration in archive {archive.root}; {hint}")
    # of a unit that has coefficients, and results of an exciter, the coefficients are meant
    first = sorted(history, key=lambda calibration: STATIC not in calibration.event.covers.split())
    valid = next((calibration for calibration in first if calibration.holds(day)), None)
    if as_json:
        shown = None if valid is None else {**valid.document(), **_made(archive, valid)}
        print_json(
            {"unit": serial, "at": day, "valid": valid is not None, "calibration": shown,
             "history": [calibration.document() for calibration in history]}
        )  # fmt: skip
    else:
        _print(serial, day, valid, history, {} if valid is None else _made(archive, valid))
    return valid is not None


def _made(archive: Archive, valid: Calibration) -> dict[str, Any]:
    """The coefficients of a calibration, with the code, libraries and data that made them."""
    from pipelines.certificates.coefficient_remarks import coefficients_of
    from pipelines.certificates.ledger import certified_table

    run = Run(archive, valid.run)
    if not (run.path / "run.json").is_file():
        return {"coefficients": None, "made": None}
    print_remarks(run, [valid.serial])
    import_arrow_alone()
    manifest = run.manifest(certified_table(run, valid.event))
    return {
        "coefficients": coefficients_of(run, valid),
        "made": {key: manifest.get(key) for key in MADE} | {"capture": run.about.get("capture")},
    }


def _print(serial: str, day: str, valid: Calibration | None, history: list[Calibration], made: dict[str, Any]) -> None:
    if valid is None:
        say(f"{serial}: no calibration is valid on {day}", style="bold red")
    else:
        event = valid.event
        say(f"{serial}: certificate {valid.certificate} is valid on {day}", style="bold green")
        say(f"  valid    {valid.start} until {valid.until}, grade {event.grade}")
        say(f"  from     run {valid.run}, recipe {event.recipe}, station {event.station}")
        say(f"  by       {event.who} on {event.where}, {event.when}")
        say(f"  tables   {event.table} {event.coefficients[:16]}…")
        if made.get("made"):
            libraries = ", ".join(f"{name} {number}" for name, number in made["made"]["libraries"].items())
            say(f"  code     {made['made']['code'][:16]}… with {libraries}")
    lines = [
        [entry.certificate, entry.event.covers, entry.start, entry.until, state, entry.run, _why(entry)]
        for entry in history
        for state in ["expired" if entry.state == "valid" and day >= entry.until else entry.state]
    ]
    print_table(["certificate", "covers", "from", "until", "state", "run", "reason"], lines)
    rows = made.get("coefficients") or []
    if rows:
        from inertial.uncertainty.rounding import rounded

        cells = [
            [r["effect"], r["axis"], r["name"], *rounded(r["value"], r["standard_error"]), r["unit_text"]] for r in rows
        ]
        print_table(["effect", "axis", "name", "value", "standard error", "unit"], cells)


def _why(calibration: Calibration) -> str:
    end = calibration.ended_by
    return end.reason or f"by {end.certificate}" if end else calibration.event.reason


NOT_NEEDED = (
    "numpy",
    *(
        "pyarrow._azurefs",
        "pyarrow._gcsfs",
        "pyarrow._hdfs",
        "pyarrow._s3fs",
    ),  # the archive has opened its own store before
)
"""Modules that Arrow imports where they are there."""


def import_arrow_alone() -> None:
    """Import Arrow and its Parquet reader without numpy, which is two fifths of the time of both, and without remote stores.

    Arrow looks for numpy once, when it is imported; only its conversions to arrays and data frames need it. So this is for a
    process that ends with its answer, and does nothing where either library is there already, as with an archive in an object
    store.
    """
    if not {"numpy", "pyarrow"} & sys.modules.keys():
        for name in NOT_NEEDED:
            sys.modules[name] = None  # type: ignore[assignment] - how a process says that a library is not there
        try:
            import_module("pyarrow.parquet")
        finally:
            for name in NOT_NEEDED:
                del sys.modules[name]
