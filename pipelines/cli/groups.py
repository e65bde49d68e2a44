"""Commands that have subcommands."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from typer._click import Context

SPELLED = {"optimize": "optimise"}  # American spelling


class _Subcommands(TyperGroup):
    """A group whose first argument may be that of its usual subcommand, in place of the name of one."""

    usual = ""

    def parse_args(self, ctx: "Context", args: list[str]) -> list[str]:
        """The arguments, with the usual subcommand added where none is given."""
        args = [SPELLED.get(args[0], args[0]), *args[1:]] if args else args
        if self.usual and (not args or args[0] not in {*self.commands, "--help", "-h"}):
            args = [self.usual, *args]
        return super().parse_args(ctx, args)


def group(summary: str, subcommands: dict[str, Callable[..., Any]], *, usual: str = "") -> typer.Typer:
    """A command with subcommands by name.

    usual : the subcommand that is meant where the first word is not the name of one; without it, no word is the help
    """
    made = typer.Typer(
        cls=type("Subcommands", (_Subcommands,), {"usual": usual}),
        help=summary,
        no_args_is_help=not usual,
        add_completion=False,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for name, function in subcommands.items():
        made.command(name)(function)
    return made
