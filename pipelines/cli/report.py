"""``tumbleline report``: the path of a run's report."""

import typer

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument
from pipelines.cli.printing import error_console, give

PART = "Results"
ORDER = 330
SUMMARY = "Print the path of a run's report; write the report if it is missing."
EXAMPLES = ("tumbleline report latest", "tumbleline report line-six --archive archive")


def command(run: RunArgument = "latest", archive: ArchiveOption = None, *, as_json: JsonOption = False) -> None:
    """Print the path of a run's report; write the report if it is missing or older than the run's tables."""
    from pipelines.report import make_report

    stored = Archive(archive).run(run)
    with error_console().status("drawing the report"):
        make_report(stored)
    give({"run": stored.id, "report": str(stored.report)}, lambda _: typer.echo(stored.report), as_json=as_json)
