"""Effects of a user's Python file: what is wrong with one is said with file, class and line, and a wrong shape is refused."""

import inspect
import traceback
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.effects.base import Effect, Nonlinear, SensorEffect, StationEffect
from inertial.errors import BrokenEffect, InertialError

NEEDED = ("id", "symbol", "equation", "source", "typical_ug", "breaker")
METHODS = ("parameters", "constants", "names", "names_at", "columns", "start_columns", "force_change", "start_change")


def checked_classes(module: ModuleType, source: Path) -> None:
    """Refuse effect classes of a file that are not complete, and let their methods name file, class and line of an error.

    Raises
    ------
    BrokenEffect
        An attribute or a method is missing.
    """
    kinds = [item for item in vars(module).values() if isinstance(item, type) and item.__module__ == module.__name__]
    for item in dict.fromkeys(kinds):
        base_of_others = not hasattr(item, "id") and any(issubclass(k, item) for k in kinds if k is not item)
        if not issubclass(item, Effect) or base_of_others:
            continue
        where = f"effect file {source}, class {item.__name__} (line {_first_line(item)})"
        if not issubclass(item, SensorEffect | StationEffect):
            raise BrokenEffect(f"{where}: a subclass of Effect; derive it from SensorEffect or StationEffect")
        missing = [name for name in NEEDED if not hasattr(item, name)]
        if missing:
            raise BrokenEffect(f"{where}: no {' and no '.join(missing)}, an effect needs it; add it to the class")
        methods: list[str] = sorted(getattr(item, "__abstractmethods__", ()))
        if not item.coefficients and item.names in {SensorEffect.names, StationEffect.names}:
            methods.append("names")
        if methods:
            raise BrokenEffect(f"{where}: no method {' and no method '.join(methods)}, it is needed; define it")
        for parameter in item.nonlinear:
            _refuse_parameter(parameter, where)
        for name in METHODS:
            if name in vars(item):
                setattr(item, name, _guarded(vars(item)[name], where, source))


def _refuse_parameter(parameter: object, where: str) -> None:
    """Refuse what is no nonlinear parameter, and bounds that no search can begin from."""
    if not isinstance(parameter, Nonlinear):
        raise BrokenEffect(
            f"{where}: nonlinear holds {parameter!r}, a Nonlinear is needed; give its name, unit and bounds"
        )
    low, high = parameter.low, parameter.high
    if not parameter.choices and not (low < high and (low > 0.0 or parameter.scale == "linear")):
        above_zero = "" if parameter.scale == "linear" else f", both above zero for scale {parameter.scale}"
        raise BrokenEffect(
            f"{where}: nonlinear {parameter.name}: bounds {low:g} and {high:g}, the lower one is needed first{above_zero}; "
            "correct them"
        )


def raised_in(source: Path, error: BaseException) -> str:
    """An exception of a user's file, with the line of the file where it was raised."""
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}: SyntaxError: {error.msg}"
    frames = [f for f in traceback.extract_tb(error.__traceback__) if Path(f.filename).resolve() == source.resolve()]
    where = f"line {frames[-1].lineno}" if frames else "outside of the file"
    inside = f" in {frames[-1].name}" if frames and frames[-1].name != "<module>" else ""
    return f"{where}{inside}: {type(error).__name__}: {error}"


def _first_line(kind: type) -> int | str:
    try:
        return inspect.getsourcelines(kind)[1]
    except (OSError, TypeError):
        return "?"


def _guarded(method: Callable[..., Any], where: str, source: Path) -> Callable[..., Any]:
    """The method of a class, whose exceptions other than refusals of this package become :class:`BrokenEffect`."""

    @wraps(method)
    def guarded(self: Any, *given: Any, **named: Any) -> Any:
        try:
            made = method(self, *given, **named)
        except InertialError:
            raise
        except Exception as error:  # whatever a user's file raises is reported with its class and line
            raise BrokenEffect(f"{where}: {raised_in(source, error)}; mend the file") from error
        if method.__name__ not in {"columns", "force_change"}:
            return made
        state = given[0] if given else named["state"]
        if method.__name__ == "columns":
            axis = given[1] if len(given) > 1 else named["axis"]
            rest = {name: value for name, value in named.items() if name not in {"state", "axis"}}
            return _shaped(made, (*state.force.shape[:-1], len(self.names_at(axis, **rest))), where, "columns")
        return _shaped(made, (*state.force.shape, len(self.names())), where, "force_change")

    return guarded


def _shaped(made: Any, needed: tuple[int, ...], where: str, method: str) -> Array:
    """What a method returned, for every unit; refused unless it has the dwells and coefficients of ``needed`` in this order."""
    try:
        values = np.asarray(made, dtype=float)
        shape = np.broadcast_shapes(values.shape, needed)
    except (TypeError, ValueError):
        values = shape = None
    trailing = 2 if method == "columns" else 3  # axes that are the effect's: dwells (and force axes) and coefficients
    if values is None or shape is None or values.shape[-trailing:] != needed[-trailing:]:
        found = f"shape {np.shape(made)}" if isinstance(made, np.ndarray) else type(made).__name__
        what = "dwells, coefficients" if method == "columns" else "dwells, 3, parameters"
        raise BrokenEffect(
            f"{where}: {method} returned {found}, shape {needed} is needed (…, {what}; as many as names gives); "
            "inertial.effects.base.stack makes it"
        )
    if not np.isfinite(values).all():
        raise BrokenEffect(
            f"{where}: {method} returned values that are not finite, finite numbers are needed at every dwell and between all "
            "bounds of its parameters; mend the file"
        )
    return values if values.shape == shape else np.broadcast_to(values, shape)
