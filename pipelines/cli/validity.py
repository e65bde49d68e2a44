"""The calibration of a unit that is valid on a date, as text and as JSON; it reads a few small files and no table library."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from pipelines.archive import Archive, Run
from pipelines.certificates import Calibration
from pipelines.cli.printing import print_json, print_table, remark, say
from schemas.errors import WrongUse

MADE = ("stage", "code", "key", "libraries", "schema", "inputs", "parameters", "who", "where", "when")


def print_remarks(run: Run, serials: Sequence[str]) -> None:
    """Print missing or foreign signatures and differing library versions on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks, signature_remarks

    for line in (*signature_remarks(run, serials), *library_remarks(run)):
        remark(f"show: {line}")


def show_validity(archive: Archive, serial: str, at: str, known: str, *, as_json: bool) -> bool:
    """Print the calibration that is valid on a day; return whether there is one."""
    from pipelines.certificates import Ledger
    from pipelines.certificates.days import day_of, today

    day = day_of(at, "--at") if at else today()
    history = Ledger(archive).calibrations(serial, day_of(known, "--known") if known else "")
    if not history:
        raise WrongUse(
            f"show: unit {serial!r} has no calibration in archive {archive.root}; certify one with 'tumbleline certify'"
        )
    valid = next((one for one in history if one.holds(day)), None)
    if as_json:
        shown = None if valid is None else {**valid.document(), **_made(archive, valid)}
        print_json(
            {"unit": serial, "at": day, "valid": valid is not None, "calibration": shown,
             "history": [one.document() for one in history]}
        )  # fmt: skip
    else:
        _print(serial, day, valid, history, {} if valid is None else _made(archive, valid))
    return valid is not None


def _made(archive: Archive, valid: Calibration) -> dict[str, Any]:
    """The coefficients of a calibration, with the code, libraries and data that made them."""
    from pipelines.certificates.coefficient_remarks import coefficients_of

    run = Run(archive, valid.run)
    if not (run.path / "run.json").is_file():
        return {"coefficients": None, "made": None}
    print_remarks(run, [valid.serial])
    import_arrow_alone()
    manifest = run.manifest("coefficients")
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
        say(f"  tables   coefficients {event.coefficients[:16]}…")
        if made.get("made"):
            libraries = ", ".join(f"{name} {number}" for name, number in made["made"]["libraries"].items())
            say(f"  code     {made['made']['code'][:16]}… with {libraries}")
    lines = [[one.certificate, one.start, one.until, one.state, one.run, _why(one)] for one in history]
    print_table(["certificate", "from", "until", "state", "run", "reason"], lines)
    rows = made.get("coefficients") or []
    if rows:
        from inertial.uncertainty.rounding import rounded

        cells = [
            [r["effect"], r["axis"], r["name"], *rounded(r["value"], r["standard_error"]), r["unit_text"]] for r in rows
        ]
        print_table(["effect", "axis", "name", "value", "standard error", "unit"], cells)


def _why(one: Calibration) -> str:
    return one.ended_by.reason or f"by {one.ended_by.certificate}" if one.ended_by else one.event.reason


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
