"""Texts of the command line as they are given, without the validators of typer.

Recent versions of typer convert every value by pydantic, whose import and whose validators are a third of the time of a short
command. A text needs no conversion, and a parameter that is not given has no value. All other values are left to typer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from typer._click import Command, Context, Parameter


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
        for one in found:
            _take_as_given(one)
        return found

    setattr(command, "get_params", parameters)  # noqa: B010 - a method of the class


def _take_as_given(parameter: Parameter) -> None:
    described = getattr(parameter, "type_descriptor", None)
    convert = getattr(parameter, "get_runtime_param", None)
    if described is None or convert is None or "get_runtime_param" in vars(parameter):
        return
    text = described.annotation is str and described.parameter_info.parser is None
    own = _AsGiven(convert, text=text)
    setattr(parameter, "get_runtime_param", lambda: own)  # noqa: B010 - a method of the class
