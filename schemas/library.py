"""Optional libraries: imported when they are needed, with a message how to install them."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from schemas.errors import WrongUse


def library(module: str, extra: str, where: str) -> Any:
    """The module of an optional library.

    Raises
    ------
    WrongUse
        It is not installed; the message has the command that installs it.
    """
    try:
        return import_module(module)
    except ImportError:
        raise _missing(module, extra, where) from None


def require(module: str, extra: str, where: str) -> None:
    """Refuse, as :func:`library` does, an optional library that is not installed; it is not imported."""
    if find_spec(module) is None:
        raise _missing(module, extra, where)


def _missing(module: str, extra: str, where: str) -> WrongUse:
    return WrongUse(
        f"{where}: needs the library {module}, which is not installed; install it with: pip install 'tumbleline[{extra}]'"
    )
