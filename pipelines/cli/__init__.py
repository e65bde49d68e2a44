"""The command line. A command's module is imported when the command is used, so that help answers at once."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperCommand, TyperGroup

from inertial.errors import InertialError
from schemas.errors import UNUSABLE, TumblelineError, WrongUse, did_you_mean

if TYPE_CHECKING:
    from typer._click import Command, Context

INTERRUPTED = 130  # as shells tell of Ctrl-C

COMMANDS: dict[str, tuple[str, str]] = {
    "run": ("run", "Measure and calibrate a lot, from recipe to report: the main job."),
    "operator": ("operator", "Answer runs that wait for somebody to load, help or unload."),
    "demo": ("demo", "See a hidden effect found, added and the error fall."),
    "import": ("import_", "Bring recordings of others into the archive."),
    "list": ("list", "List the runs of the archive."),
    "show": ("show", "Show a run, one of its tables, or which calibration of a unit holds on a date."),
    "certify": ("certify", "Certify a run's units that passed: from when until when their calibration holds."),
    "revoke": ("revoke", "Revoke a unit's calibration, with the reason."),
    "lineage": ("lineage", "Tell where certificates, tables and samples came from, and what was made of them."),
    "verify": ("verify", "Compute every hash of the archive anew: find what was changed, edited or lost."),
    "fit": ("fit", "Fit a model to archived data again, with other effects if wanted."),
    "rerun": ("rerun", "Run archived runs through today's code, another model or other limits."),
    "diff": ("diff", "Tell what differs between two runs, by how much, and because of what."),
    "whatif": ("whatif", "Tell what a model would make of the archive's lots, before it is released."),
    "release": ("release", "Make a model the line's from a date, or list the releases."),
    "audit": ("audit", "Audit the archive: what drifts, what is due, which station moved, how the population stands."),
    "query": ("query", "Ask the archive in SQL."),
    "compare": ("compare", "Judge a model on dwells, and on fresh ones."),
    "diagnose": ("diagnose", "Say whether a model is adequate, where it fails, and which effect is missing."),
    "investigate": ("investigate", "Measure a lot, and then only what tells apart what its model may lack."),
    "extend": ("extend", "Write the next version of a model with one more effect."),
    "history": ("history", "Show the error over the versions of a model."),
    "plan": ("plan", "Say what a recipe can and cannot see, before it is measured."),
    "report": ("report", "Say where a run's report is; make it where it is missing."),
    "export": ("export", "Write coefficients for firmware and autopilots."),
    "archive": ("archive", "Look after the archive: the key that signs, what killed writers left."),
    "station": ("station", "See, check, serve and describe stations."),
}


class _OnDemand(TyperCommand):
    """A command known by name and one line of help; the rest is in its module."""

    def __init__(self, name: str, module: str, summary: str) -> None:
        super().__init__(name, help=summary)
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
    """The commands in the order in which they are used."""

    def list_commands(self, ctx: Context) -> list[str]:
        """Names of the commands."""
        del ctx
        return [*COMMANDS]  # the module cli.list hides the built-in of that name here once it is imported

    def resolve_command(self, ctx: Context, args: list[str]) -> tuple[str | None, Command | None, list[str]]:
        """The command that the arguments begin with; one that is not there is told with close matches."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            message = f"no command is called '{args[0]}'; {did_you_mean(args[0], COMMANDS)}"
            raise WrongUse(message)
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


@app.callback()
def _product() -> None:
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
        raise


def _leave(message: str, status: int) -> None:
    sys.stdout.flush()
    sys.stderr.write(f"tumbleline: {message}\n")
    sys.exit(status)
