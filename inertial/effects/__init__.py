"""The catalogue of physical effects: every module of this package, every entry point ``tumbleline.effects``, every file added.

Nothing names an effect but its own file: fitting, simulating, diagnosing, planning, documents and export ask here.
"""

import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import ModuleType

from inertial.effects.base import AnyEffect, Effect, Nonlinear, SensorEffect, StationEffect
from inertial.effects.covariate import COVARIATE_PREFIX, Covariate
from inertial.effects.own_file import checked_classes, raised_in
from inertial.errors import BrokenEffect, UnknownEffect

__all__ = [
    "BrokenEffect",
    "Effect",
    "Nonlinear",
    "SensorEffect",
    "StationEffect",
    "add_file",
    "additions_forgotten",
    "built_in",
    "catalogue",
    "get",
    "register",
]

OF_A_FILE = "tumbleline_effect_"  # begins the name of the module of a user's file
_extra: dict[str, AnyEffect] = {}


@cache
def _built_in() -> dict[str, AnyEffect]:
    effects: dict[str, AnyEffect] = {}
    for info in pkgutil.iter_modules(__path__):
        _collect(importlib.import_module(f"{__name__}.{info.name}"), effects)
    for point in entry_points(group="tumbleline.effects"):
        _collect_point(point, effects)
    return effects


def _collect_point(point: EntryPoint, effects: dict[str, AnyEffect]) -> None:
    """The effects of an installed package: its entry point names a module that defines them, or one effect class."""
    try:
        loaded = point.load()
    except Exception as error:  # whatever another package raises is reported with the entry point's name
        raise BrokenEffect(
            f"entry point {point.name} = {point.value}: does not load ({error}); mend or remove that package"
        ) from error
    if isinstance(loaded, type) and issubclass(loaded, Effect) and hasattr(loaded, "id"):
        if loaded.id in effects:
            raise BrokenEffect(f"{point.value}: effect id '{loaded.id}' is taken already; choose another id")
        effects[loaded.id] = loaded()  # type: ignore[assignment]  # an Effect with an id is one of its two kinds
    elif not isinstance(loaded, ModuleType) or not _collect(loaded, effects):
        raise BrokenEffect(
            f"entry point {point.name} = {point.value}: holds no effect; name a module or class that does"
        )


def _collect(module: ModuleType, effects: dict[str, AnyEffect]) -> list[str]:
    """Instances of the effect classes that a module defines, added to ``effects`` by id."""
    added: list[str] = []
    for item in vars(module).values():
        defined_here = isinstance(item, type) and issubclass(item, Effect) and item.__module__ == module.__name__
        if defined_here and hasattr(item, "id"):
            if item.id in effects:
                raise BrokenEffect(f"{module.__name__}: effect id '{item.id}' is taken already; choose another id")
            effects[item.id] = item()  # type: ignore[assignment]  # an Effect with an id is one of its two kinds
            added.append(item.id)
    return added


def catalogue() -> dict[str, AnyEffect]:
    """Every known effect by id; covariates are made on demand by :func:`get`."""
    return {**_built_in(), **_extra}


def get(name: str) -> AnyEffect:
    """The effect with this id; ``covariate:<column>`` for any recorded column.

    Raises
    ------
    UnknownEffect
        With the close matches.
    """
    if name.startswith(COVARIATE_PREFIX) and len(name) > len(COVARIATE_PREFIX):
        return Covariate(name.removeprefix(COVARIATE_PREFIX))
    effect = _extra.get(name) or _built_in().get(name)
    if effect is None:
        raise UnknownEffect(name, catalogue())
    return effect


def get_all(names: Iterable[str]) -> list[AnyEffect]:
    """The effects with these ids, in order, each once."""
    return [get(name) for name in dict.fromkeys(names)]


def register(effect: AnyEffect) -> None:
    """Adds an effect made at run time (a formula of a model file) to the catalogue."""
    _extra[effect.id] = effect


def built_in() -> dict[str, AnyEffect]:
    """The effects of this package and of installed ones, without files and formulas added at run time."""
    return dict(_built_in())


@contextmanager
def additions_forgotten() -> Generator[None]:
    """A block after which files and formulas added inside it are forgotten."""
    before = dict(_extra)
    try:
        yield
    finally:
        _extra.clear()
        _extra.update(before)


def add_file(path: str | Path) -> list[str]:
    """Ids of the effects that a Python file outside the tree adds.

    Raises
    ------
    BrokenEffect
        The file is missing, does not import, or holds no effect, or a class of it lacks an attribute or a method. What its
        methods raise or return later is refused in the same way, see :mod:`inertial.effects.own_file`.
    """
    source = Path(path)
    spec = importlib.util.spec_from_file_location(f"{OF_A_FILE}{source.stem}", source)
    if spec is None or spec.loader is None or not source.is_file():
        raise BrokenEffect(
            f"effect file {source}: no such Python file; give the path of a .py file that defines an effect"
        )
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's file raises is reported with the file's name
        raise BrokenEffect(f"effect file {source}: {raised_in(source, error)}; mend the file") from error
    checked_classes(module, source)
    known = dict(catalogue())
    added = _collect(module, known)
    if not added:
        raise BrokenEffect(
            f"effect file {source}: holds no effect; define a subclass of SensorEffect or StationEffect with an id"
        )
    for name in added:
        register(known[name])
    return added
