"""``tumbleline run``: the main job, from recipe to report."""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, error_console, print_json

if TYPE_CHECKING:
    from collections.abc import Callable, Generator

    from pipelines.progress import Progress
    from pipelines.runner import Done


def command(
    recipe: Annotated[
        str, typer.Argument(metavar="[RECIPE]", help="A recipe file or a built-in recipe.")
    ] = "production",
    station: Annotated[
        Path | None,
        typer.Option("--station", metavar="FILE", help="The station; the built-in simulated one by default."),
    ] = None,
    units: Annotated[str, typer.Option("--units", metavar="SN,…", help="Serial numbers, slot by slot.")] = "",
    archive: ArchiveOption = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed of a simulated station.")] = None,
    repeat: Annotated[
        int,
        typer.Option("--repeat", min=0, help="Count of fresh measurements of the same lot: 1, 2, … measure it anew."),
    ] = 0,
    *,
    direct: Annotated[bool, typer.Option("--direct", help="Run the same chain without the orchestrator.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure and calibrate a lot, from recipe to report: the main job.

    The same command, given again after it was stopped, goes on where it was; given again after it was finished, it
    measures nothing and shows the result.
    """
    from pipelines.archive import Archive
    from pipelines.cli.summary import exit_status, print_summary, summary
    from pipelines.job import Request
    from pipelines.runner import Runner

    request = Request(recipe=recipe, station=station, units=_serials(units), seed=seed, repeat=repeat)
    job = request.job()
    store = Archive(archive)
    with _shown() as (progress, told):
        if direct:
            runner = Runner(job, store, progress)
            for done in runner.all():
                told(done)
            run = runner.run
        else:
            from pipelines.flows.local import run_locally

            run = run_locally(request, job, store, progress, told)
    document = summary(run)
    if as_json:
        print_json(document)
    else:
        print_summary(document)
    raise typer.Exit(exit_status(document))


def _serials(text: str) -> tuple[str, ...]:
    """Serial numbers of a comma-separated list; blanks around them do not count."""
    return tuple(serial.strip() for serial in text.split(",")) if text else ()


@contextmanager
def _shown() -> Generator[tuple[Progress, Callable[[Done], None]], None, None]:
    """A progress bar for the capture and a line per stage, on standard error."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    out = error_console()
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=out, transient=True) as bars:
        bar = bars.add_task("starting", total=None)

        def progress(done: int, total: int, note: str) -> None:
            bars.update(bar, completed=done, total=total, description=f"capture  {note}")

        def told(done: Done) -> None:
            how = "was there" if done.reused else f"{done.seconds:.1f} s"
            bars.console.print(f"{done.stage:<9} {how}", markup=False)
            bars.update(bar, description="computing", completed=0, total=None)

        yield progress, told
