"""``tumbleline doctor``: what is configured, reachable, authenticated, writable and in time, with which versions."""

from typing import Annotated

from pipelines.cli.options import ArchiveOption, JsonOption, StationOption, option
from pipelines.cli.printing import conclude, print_table, say
from pipelines.doctor.documents import DoctorDocument

PART = "Measure"
ORDER = 165
SUMMARY = "Check installation, archive, orchestrator, station and clock; a remedy for each fault."
EXAMPLES = ("tumbleline doctor", "tumbleline doctor --station line-1.toml --json")

COLOURS = {"good": "green", "warning": "yellow", "fault": "bold red", "not configured": "dim"}


def command(
    archive: ArchiveOption = None,
    station: StationOption = None,
    free_gb: Annotated[float, option("--free-gb GB", "Free space that the archive needs.", min=0.0)] = 1.0,
    *,
    as_json: JsonOption = False,
) -> None:
    """Check the installation and its connections, with a remedy for each fault.

    Nothing is moved. A file of 1 MiB is written to the archive and to the state folder, read back and
    removed. A station is checked only if --station names it. Exit 1: at least one fault; warnings leave it at 0.
    """
    from pipelines.doctor.examine import examine

    document = examine(archive, station, free_gb)
    conclude(document, _show, as_json=as_json, passed=document["ok"])


def _show(document: DoctorDocument) -> None:
    from rich.text import Text

    checks = document["checks"]
    lines = [
        [c.part, c.check, Text(c.state, COLOURS[c.state]), c.found if c.state == "good" else "see below"]
        for c in checks
    ]
    print_table(["part", "check", "state", "found"], lines, fixed=3)
    if document["samples"]:
        say(f"sample recipes and stations: {document['samples']}")
    for state in ("not configured", "warning", "fault"):
        for c in (c for c in checks if c.state == state):
            needed = f", needed: {c.needed}" if c.needed else ""
            remedy = f"; {c.remedy}" if c.remedy else ""
            say(f"{state}: {c.part}, {c.check}: {c.found}{needed}{remedy}", style=COLOURS[state])
    say(f"{document['faults']} faults, {document['warnings']} warnings")
