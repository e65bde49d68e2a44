"""The command line. The module of a command is imported when the command is used, so that help starts quickly."""

from __future__ import annotations

import errno
import os
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from inspect import cleandoc
from io import TextIOWrapper
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup

from inertial.errors import InertialError
from pipelines.cli.former import present
from schemas.errors import DONE, UNEXPECTED, UNUSABLE, TumblelineError, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.log_lines import VARIABLE as LOG
from schemas.log_lines import tell
from schemas.own_files import report_to

if TYPE_CHECKING:
    from typer._click import Command, Context, Parameter

INTERRUPTED = 130  # the exit status that shells use for Ctrl-C
PIPE_CLOSED = 141  # the exit status that shells use for a reader that closed the pipe

SURROGATES = "surrogates not allowed"  # the reason that Python gives where bytes of a name are no text

COMPLETES = "_TUMBLELINE_COMPLETE"  # variable by which a shell asks for candidates; typer defines its name
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Variables that BLAS libraries read when they are loaded."""


CONSTANT = re.compile(r'^(PART|ORDER|SUMMARY) = (?:"(.+)"|(\d+))$', re.MULTILINE)
COMMAND = re.compile(r"^(?:def command|app = group)\(", re.MULTILINE)


class IncompleteCommand(Exception):
    """A module with an incomplete command: a defect that its author must correct."""


class CommandModule(NamedTuple):
    """A command in the help.

    module : name inside this package · part : heading of the help · order : place in the help · summary : one sentence
    """

    module: str
    part: str
    order: int
    summary: str


def find_commands(folder: Path) -> dict[str, CommandModule]:
    """The commands of a folder by name, in the order of the help.

    The name is the name of the module; a module with a reserved name of Python ends in an underscore (``import_``).

    Raises IncompleteCommand: a module has the function or application of a command without its constants, or the reverse, or an
    ORDER twice.
    """
    commands: dict[str, CommandModule] = {}
    for path in sorted(folder.glob("*.py")):
        if path.stem.startswith("__"):
            continue
        command = _read(path)
        if command is not None:
            commands[path.stem.removesuffix("_")] = command
    ordered = sorted(commands.items(), key=lambda item: item[1].order)
    for (first, earlier), (second, later) in pairwise(ordered):
        if earlier.order == later.order:
            raise IncompleteCommand(f"{second}.py: ORDER is {earlier.order}, as in {first}.py; choose another number")
    return dict(ordered)


def _read(path: Path) -> CommandModule | None:
    """The command of a module; None for a module without a command."""
    text = path.read_text(encoding="utf-8")
    values = {name: string or number for name, string, number in CONSTANT.findall(text)}
    callable_ = COMMAND.search(text) is not None
    if not values and not callable_:
        return None
    missing = [name for name in ("PART", "ORDER", "SUMMARY") if name not in values]
    if missing or not callable_ or not values["ORDER"].isdigit():
        needed = ", ".join(missing) or (
            "an integer ORDER" if callable_ else "a function 'command' or 'app = typer.Typer('"
        )
        raise IncompleteCommand(f"{path.name}: a command without {needed}; add it on a line of its own")
    return CommandModule(path.stem, values["PART"], int(values["ORDER"]), values["SUMMARY"])


COMMANDS = find_commands(Path(__file__).parent)  # the commands by name, in the order of the help


class _OnDemand(TyperCommand):
    """A command with its name and one line of help; its module is imported at its first use."""

    def __init__(self, name: str) -> None:
        stated = COMMANDS[name]
        super().__init__(name, help=stated.summary, rich_help_panel=stated.part)
        self._module = stated.module

    def make_context(self, *args: Any, **kwargs: Any) -> Context:
        """The context of the real command."""
        return self._load().make_context(*args, **kwargs)

    def _load(self) -> Command:
        module = import_module(f"{__name__}.{self._module}")
        application = getattr(module, "app", None)
        if application is None:
            application = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
            application.command(self.name)(module.command)
        command = typer.main.get_command(application)
        from pipelines.cli.candidates import attach

        attach(command)
        for cli_command in (command, *getattr(command, "commands", {}).values()):
            cli_command.help = flowing(cli_command.help or "")
            _name_arguments_once(cli_command)
            take_texts_as_given(cli_command)
        command.epilog = _examples(getattr(module, "EXAMPLES", ()), getattr(module, "EPILOG", ()))
        of_subcommands: dict[str, tuple[str, ...]] = getattr(module, "EXAMPLES_OF", {})
        for name, examples in of_subcommands.items():
            getattr(command, "commands")[name].epilog = _examples(examples)  # noqa: B009 - a command without them has none
        return command


def _name_arguments_once(command: Command) -> None:
    """Make the usage line show arguments as the command states them, the optional ones in one pair of brackets.

    typer puts braces around those that are needed, and brackets around names that have them.
    """
    for parameter in command.params:
        stated = getattr(parameter, "metavar", None)
        if stated and parameter.param_type_name == "argument":
            shown_name = stated if parameter.required or stated.startswith("[") else f"[{stated}]"
            setattr(parameter, "get_usage_pieces", lambda _context, name=shown_name: [name])  # noqa: B010 - a method of the class


def flowing(text: str) -> str:
    """A help text whose paragraphs are one line each, so that a terminal breaks them at its own width only; lists are kept."""
    paragraphs = cleandoc(text).split("\n\n")
    return "\n\n".join(
        paragraph
        if any(line.startswith((" ", "-", "*", "\b")) for line in paragraph.splitlines())
        else " ".join(paragraph.splitlines())
        for paragraph in paragraphs
    )


def _examples(lines: Sequence[str], before: Sequence[str] = ()) -> str:
    """The end of a help text: a paragraph for each example, after paragraphs of the command's own."""
    return "\n\n".join([*before, "Examples:", *lines])


class _Commands(TyperGroup):
    """The commands in the parts of the help."""

    def __init__(self, **named: Any) -> None:
        super().__init__(**named)
        take_texts_as_given(self)

    def list_commands(self, ctx: Context) -> list[str]:
        """Names of the commands."""
        return [*COMMANDS]  # after its import the module cli.list hides the built-in ``list`` here

    def resolve_command(self, ctx: Context, args: list[str]) -> tuple[str | None, Command | None, list[str]]:
        """The command that the first argument names; a former name is followed, an unknown one refused with similar names."""
        words = present(args)
        if words != [*args]:
            if COMPLETES not in os.environ:
                tell(
                    f"former names, accepted for one release; now: {shlex.join(['tumbleline', *words])}",
                    level="warning",
                )
            args = words
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            raise WrongUse(f"no command is called '{shown(args[0])}'; {did_you_mean(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def get_command(self, ctx: Context, cmd_name: str) -> Command | None:
        """The command of this name."""
        return _OnDemand(cmd_name) if cmd_name in COMMANDS else None


app = typer.Typer(
    cls=_Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(requested: bool) -> None:
    if requested:
        from importlib.metadata import version

        typer.echo(f"tumbleline {version('tumbleline')}")
        raise typer.Exit


def _choose_log(form: str) -> str:
    """Make messages text or JSON, before a command is looked for; without the option TUMBLELINE_LOG decides."""
    if form not in {"", "text", "json"}:
        raise WrongUse(f"--log is '{shown(form)}', text or json is needed; correct it")
    if form:
        os.environ[LOG] = form
    return form


@app.callback()
def _product(
    *,
    log: Annotated[
        str,
        typer.Option(
            "--log",
            metavar="text|json",
            callback=_choose_log,
            is_eager=True,
            help="Form of messages on standard error.",
        ),
    ] = "",
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Calibrate accelerometers in production: measure, fit, judge the model, grade, with traceable results."""


def main() -> None:
    """Run the command line; an error that the user can correct is one message on standard error and an exit status."""
    _one_thread()
    _text_for_every_encoding()
    report_to(lambda line: typer.echo(line, err=True))
    try:
        app()
    except TumblelineError as problem:
        if COMPLETES in os.environ:  # a press of the tab key prints no message
            sys.exit(DONE)
        _leave(str(problem), problem.exit_status)
    except InertialError as problem:
        _leave(str(problem), UNUSABLE)
    except SystemExit as left:
        if left.code == INTERRUPTED:
            _stopped()
        if left.code == 1 and isinstance(left.__context__, OSError) and left.__context__.errno == errno.EPIPE:
            sys.exit(PIPE_CLOSED)  # status 1 is a verdict
        raise
    except Exception as problem:  # noqa: BLE001 - a defect: one line, details in a file, never exit status 1
        # pydantic makes an exception of its own of Ctrl-C, with the name of the other in its text alone
        if "KeyboardInterrupt" in repr((problem, problem.__cause__, problem.__context__)):
            _stopped()
        _unexpected(problem)


def _stopped() -> None:
    """End after Ctrl-C."""
    goes_on = sys.argv[1:2] in (["run"], ["investigate"])
    _leave(f"stopped; give the command again{' to continue the run' if goes_on else ''}", INTERRUPTED)


def _unexpected(problem: Exception) -> None:
    """End with what a person can do about an exception, or with a report for the developers."""
    if isinstance(problem, MemoryError):
        _leave("the command needs more memory than is available; give it less data at once", UNUSABLE)
    if isinstance(problem, OSError) and problem.errno in {errno.ENOSPC, errno.EDQUOT, errno.EROFS}:
        named = f"'{shown(str(problem.filename))}'" if problem.filename else "a file"
        _leave(
            f"{named} cannot be written ({problem.strerror}); make room, or choose a folder with write permission, and give the "
            "command again",
            UNUSABLE,
        )
    if isinstance(problem, OSError) and problem.errno == errno.ENAMETOOLONG:
        _leave(
            f"'{shown(str(problem.filename))}': the file name is too long for this system; give a shorter one", UNUSABLE
        )
    if isinstance(problem, UnicodeEncodeError) and problem.reason == SURROGATES:
        around = problem.object[max(problem.start - 40, 0) : problem.end + 40]
        _leave(
            f"'{shown(around)}': the name of a file or folder is not in the encoding of this system "
            f"({sys.getfilesystemencoding()}); rename it, or set LC_ALL to the encoding of its name",
            UNUSABLE,
        )
    from schemas.installed import not_installed

    missing = not_installed(problem)
    if missing is not None:
        _leave(missing, UNUSABLE)
    from pipelines.cli.unexpected import write_report

    _leave(write_report(problem), UNEXPECTED)


def _one_thread() -> None:
    """One BLAS thread, unless the user has set another number: on small matrices threads wait for each other.

    The libraries read the number when they are loaded, so it is set before a command imports numpy; child processes inherit it.
    """
    for name in THREADS:
        os.environ.setdefault(name, os.environ.get("OMP_NUM_THREADS", "1"))


def _text_for_every_encoding() -> None:
    """Let the streams write '?' for characters that their encoding lacks, as that of a pipe on Windows lacks '√'.

    A stream that writes the bytes of names as they are, as in the C locale, stays so: its paths can be copied.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors != "surrogateescape":
            stream.reconfigure(errors="replace")


def _leave(message: str, status: int) -> None:
    sys.stdout.flush()
    tell(message, level="error", status=status)
    sys.exit(status)


class _AsGiven:
    """The conversion of one parameter; ``convert`` makes that of typer, for the values that need it."""

    def __init__(self, convert: Callable[[], Any], *, text: bool) -> None:
        self._convert, self._text = convert, text

    def coerce(self, value: Any, param: Any, ctx: Context) -> Any:
        """The value of a parameter as its command receives it."""
        several = param.multiple or param.nargs == -1
        if value is None:
            return () if several else None
        if self._text and not several and isinstance(value, str):
            return value
        return self._convert().coerce(value, param=param, ctx=ctx)


def take_texts_as_given(command: Command) -> None:
    """Let texts, and parameters that are not given, pass without the validators of typer, where it has them."""
    stated = command.get_params  # typer adds the option of help when a context asks for it

    def parameters(ctx: Context) -> list[Parameter]:
        found = stated(ctx)
        for parameter in found:
            _take_as_given(parameter)
        return found

    setattr(command, "get_params", parameters)  # noqa: B010 - a method of the class


def _take_as_given(parameter: Parameter) -> None:
    described = getattr(parameter, "type_descriptor", None)
    convert = getattr(parameter, "get_runtime_param", None)
    if described is None or convert is None or "get_runtime_param" in vars(parameter):
        return
    text = described.annotation is str and described.parameter_info.parser is None
    as_given = _AsGiven(convert, text=text)
    setattr(parameter, "get_runtime_param", lambda: as_given)  # noqa: B010 - a method of the class
