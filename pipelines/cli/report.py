"""``tumbleline report``: the path of a run's report."""

from __future__ import annotations

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument, print_json

PART = "Results"
ORDER = 330
SUMMARY = "Print the path of a run's report; write the report if it is missing."
EXAMPLES = (
    "tumbleline report latest",
    "tumbleline report line-six --archive archive",
)


def command(run: RunArgument = "latest", archive: ArchiveOption = None, *, as_json: JsonOption = False) -> None:
    """Print the path of a run's report; write the report if it is missing or older than the run's tables."""
    from pipelines.archive import Archive
    from pipelines.report import make_report

    found = Archive(archive).run(run)
    if found.about.get("capture") or found.about.get("parents"):
        make_report(found)
    else:
        from pipelines.cli.imported_report import make_imported_report

        make_imported_report(found)
    if as_json:
        print_json({"run": found.id, "report": str(found.report)})
    else:
        typer.echo(found.report)
