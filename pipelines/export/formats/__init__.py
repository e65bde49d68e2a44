"""The export formats: each is one module of this package with a NAME and a ``write``, and is found here by itself."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Protocol, cast

from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.export.polynomials import UnitCalibration


class Format(Protocol):
    """A module that writes calibrations in one format; COMPLETE where it names effects that have no polynomial."""

    NAME: str

    def write(self, units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
        """The calibrations as text; ``nominal`` is the output per g that the receiver assumes, where the format needs it."""
        ...


def _found() -> dict[str, Format]:
    modules = (import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__))
    return {module.NAME: cast("Format", module) for module in modules}


FORMATS: dict[str, Format] = _found()


def export_text(name: str, units: Sequence[UnitCalibration], run: str, nominal: float | None = None) -> str:
    """The calibrations in one of :data:`FORMATS`.

    Parameters
    ----------
    nominal : output per g that the autopilot's driver assumes; only for parameters.

    Raises
    ------
    WrongUse
        The model has an effect that the format cannot hold, or the format needs a nominal scale.
    """
    form = FORMATS[name]
    if not getattr(form, "COMPLETE", False):
        _refuse_left_out(name, units)
    return form.write(units, run, nominal)


def _refuse_left_out(name: str, units: Sequence[UnitCalibration]) -> None:
    left = units[0].left_out
    if left:
        raise WrongUse(
            f"export: effect {', '.join(left)} has no place in format {name}, which knows bias, scale, misalignment and "
            "their temperature; export json, or fit a model without it"
        )
