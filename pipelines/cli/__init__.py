"""The command line. A command's module is imported when the command is used, so that help answers at once."""

from __future__ import annotations

import errno
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from inertial.errors import InertialError
from schemas.errors import UNEXPECTED, UNUSABLE, TumblelineError, WrongUse, did_you_mean
from schemas.foreign import shown

if TYPE_CHECKING:
    from typer._click import Command, Context

INTERRUPTED = 130  # as shells tell of Ctrl-C
NOBODY_READS = 141  # as shells tell of a pipe that was closed

MEASURE = "Measure"
FIND = "Is the model good enough, and what is missing?"
RESULTS = "Results"
TRACE = "Certificates, trace, audit"
AGAIN = "Old data, new models"

COMMANDS: dict[str, tuple[str, str, str]] = {
    "run": ("run", MEASURE, "Measure and calibrate a lot, from recipe to report: the main job."),
    "plan": ("plan", MEASURE, "Say what a recipe can and cannot see, before it is measured."),
    "investigate": ("investigate", MEASURE, "Measure a lot, and then only what tells apart what its model may lack."),
    "operator": ("operator", MEASURE, "Answer runs that wait for somebody to load, help or unload."),
    "station": ("station", MEASURE, "See, check, serve and describe stations."),
    "import": ("import_", MEASURE, "Bring recordings of others into the archive."),
    "demo": ("demo", FIND, "See a hidden effect found, added and the error fall."),
    "diagnose": ("diagnose", FIND, "Say whether a model is adequate, where it fails, and which effect is missing."),
    "extend": ("extend", FIND, "Write the next version of a model with one more effect."),
    "compare": ("compare", FIND, "Judge a model on dwells, and on fresh ones."),
    "history": ("history", FIND, "Show the error over the versions of a model."),
    "list": ("list", RESULTS, "List the runs of the archive."),
    "show": ("show", RESULTS, "Show a run, one of its tables, or which calibration of a unit holds on a date."),
    "report": ("report", RESULTS, "Say where a run's report is; make it where it is missing."),
    "export": ("export", RESULTS, "Write coefficients for firmware and autopilots."),
    "query": ("query", RESULTS, "Ask the archive in SQL."),
    "certify": ("certify", TRACE, "Certify a run's units that passed: from when until when their calibration holds."),
    "revoke": ("revoke", TRACE, "Revoke a unit's calibration, with the reason."),
    "lineage": ("lineage", TRACE, "Tell where certificates, tables and samples came from, and what was made of them."),
    "verify": ("verify", TRACE, "Compute every hash of the archive anew: find what was changed, edited or lost."),
    "audit": (
        "audit",
        TRACE,
        "Audit the archive: what drifts or is due, which station moved, how the population stands.",
    ),
    "archive": ("archive", TRACE, "Look after the archive: the key that signs, what killed writers left."),
    "fit": ("fit", AGAIN, "Fit a model to archived data again, with other effects if wanted."),
    "rerun": ("rerun", AGAIN, "Run archived runs through today's code, another model or other limits."),
    "diff": ("diff", AGAIN, "Tell what differs between two runs, by how much, and because of what."),
    "whatif": ("whatif", AGAIN, "Tell what a model would make of the archive's lots, before it is released."),
    "release": ("release", AGAIN, "Make a model the line's from a date, or list the releases."),
}
"""Name → module, part of the help, summary."""


class _OnDemand(TyperCommand):
    """A command known by name and one line of help; the rest is in its module."""

    def __init__(self, name: str, module: str, part: str, summary: str) -> None:
        super().__init__(name, help=summary, rich_help_panel=part)
        self._module = module

    def make_context(self, *args: Any, **kwargs: Any) -> Context:
        """The context of the real command."""
        return self._load().make_context(*args, **kwargs)

    def _load(self) -> Command:
        module = import_module(f"{__name__}.{self._module}")
        if hasattr(module, "app"):
            return typer.main.get_command(module.app)
        own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
        own.command(self.name)(module.command)
        return typer.main.get_command(own)


class _Commands(TyperGroup):
    """The commands by what they are for."""

    def list_commands(self, ctx: Context) -> list[str]:
        """Names of the commands."""
        del ctx
        return [*COMMANDS]  # the module cli.list hides the built-in of that name here once it is imported

    def resolve_command(self, ctx: Context, args: list[str]) -> tuple[str | None, Command | None, list[str]]:
        """The command that the arguments begin with; one that is not there is told with close matches."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            raise WrongUse(f"no command is called '{shown(args[0])}'; {did_you_mean(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """The command of this name."""
        del ctx
        return _OnDemand(cmd_name, *COMMANDS[cmd_name]) if cmd_name in COMMANDS else None


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"tumbleline {version('tumbleline')}")
        raise typer.Exit


@app.callback()
def _product(
    *,
    version: Annotated[
        bool, typer.Option("--version", callback=_tell_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Calibrate accelerometers in production: measure, fit, judge the model, grade, and keep it all traceable."""


def main() -> None:
    """Run the command line; what a person can put right is one message on standard error and an exit status."""
    try:
        app()
    except TumblelineError as problem:
        _leave(str(problem), problem.exit_status)
    except InertialError as problem:
        _leave(str(problem), UNUSABLE)
    except SystemExit as left:
        if left.code == INTERRUPTED:
            _leave("stopped; a run goes on where it was when its command is given again", INTERRUPTED)
        if left.code == 1 and isinstance(left.__context__, OSError) and left.__context__.errno == errno.EPIPE:
            sys.exit(NOBODY_READS)  # 1 would be a verdict
        raise
    except Exception as problem:  # noqa: BLE001 - a defect: told in one line, kept in a file, never a verdict
        if isinstance(problem, OSError) and problem.errno == errno.ENAMETOOLONG:
            _leave(f"'{shown(str(problem.filename))}': no file can have so long a name; give a shorter one", UNUSABLE)
        from pipelines.cli.unexpected import told

        _leave(told(problem), UNEXPECTED)


def _leave(message: str, status: int) -> None:
    sys.stdout.flush()
    sys.stderr.write(f"tumbleline: {message}\n")
    sys.exit(status)
