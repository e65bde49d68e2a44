"""Candidates for the completion of a shell: runs, units, effects, recipes and the other names that a parameter takes.

A parameter gets its candidates by its name, so that a new command has them without an entry of its own. The shell completes the
names of files itself where there are none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import Archive
from schemas.errors import TumblelineError

if TYPE_CHECKING:
    from typer._click import Command, Context, Parameter


def attach(command: Command) -> Command:
    """The command, each parameter with its candidates."""
    for subcommand in [command, *getattr(command, "commands", {}).values()]:
        for parameter in subcommand.params:
            names = candidates_of(parameter)
            if names is not None:
                completes: Any = parameter
                completes._custom_shell_complete = _completer(names)  # noqa: SLF001 - typer takes it per option, not per name
    return command


def candidates_of(parameter: Parameter) -> Callable[[Context], Iterable[str]] | None:
    """The source of candidates of a parameter; None where it takes no names."""
    if getattr(parameter, "is_flag", False):
        return None
    metavar = str(getattr(parameter, "metavar", "") or "")
    return next((names for (name, part), names in SOURCES.items() if name == parameter.name and part in metavar), None)


def _completer(names: Callable[[Context], Iterable[str]]) -> Callable[[Context, Parameter, str], list[str]]:
    def complete(ctx: Context, parameter: Parameter, incomplete: str) -> list[str]:
        """The candidates that begin as typed; after a comma those of the next name of a list."""
        listed = "," in str(getattr(parameter, "metavar", ""))
        before, comma, last = incomplete.rpartition(",") if listed else ("", "", incomplete)
        given = set(before.split(","))
        try:
            known = sorted({*names(ctx)})
        except (TumblelineError, OSError, ValueError):  # an error belongs to the command, not to a press of the tab key
            return []
        return [f"{before}{comma}{name}" for name in known if name.startswith(last) and name not in given]

    return complete


def _archive(ctx: Context) -> Archive:
    return Archive(ctx.params.get("archive"))


def _runs(ctx: Context) -> list[str]:
    return ["latest", *_archive(ctx).run_ids()]


def _units(ctx: Context) -> list[str]:
    return [unit for info in _archive(ctx).runs() for unit in info.units]


def _runs_and_units(ctx: Context) -> list[str]:
    infos = _archive(ctx).runs()
    return ["latest", *(info.id for info in infos), *(unit for info in infos for unit in info.units)]


def _recipes(ctx: Context) -> list[str]:
    from pipelines.jobs.recipes import recipe_names

    group = ctx.parent.command if ctx.parent is not None else None
    beside = getattr(group, "commands", {}) if getattr(group, "usual", "") else {}  # 'plan' alone is 'plan recipe'
    return [*recipe_names(), *beside, *_files("*.toml")]


def _stations(ctx: Context) -> list[str]:
    from schemas.own_files import own_files
    from schemas.station import BUILT_IN

    return [BUILT_IN, *own_files("stations"), *_files("*.toml")]


def _files(pattern: str) -> list[str]:
    """Files of the working folder; those of other folders are typed, or completed by the shell."""
    return [path.name for path in Path().glob(pattern)]


def _data(ctx: Context) -> list[str]:
    return [*_runs(ctx), *_files("*.parquet"), *_files("*.csv")]


def _of(module: str, name: str) -> Callable[[Context], Iterable[Any]]:
    """The names in a registry, or those that a function returns; its module is imported when they are asked for."""

    def names(_ctx: Context) -> Any:
        registry: Any = getattr(import_module(module), name)
        return registry() if callable(registry) else registry

    return names


_effects = _of("inertial.effects", "catalogue")
_limits = _of("pipelines.jobs.recipes", "limits_names")
_scenes = _of("pipelines.demo.scenes", "SCENES")

SOURCES: dict[tuple[str, str], Callable[[Context], Iterable[str]]] = {
    ("recipe", "RECIPE"): _recipes,
    ("station", "FILE"): _stations,
    ("limits", "FILE"): lambda ctx: [*_limits(ctx), *_files("*.toml")],
    ("run", "RUN|UNIT"): _runs_and_units,
    ("run", "RUN"): _runs,
    ("run_a", "RUN"): _runs,
    ("run_b", "RUN"): _runs,
    ("runs", "RUN"): _runs,
    ("calibration", "RUN"): _runs,
    ("names", "RUN|UNIT"): _runs_and_units,
    ("target", "UNIT|RUN"): _runs_and_units,
    ("selection", "SELECTION"): lambda ctx: ["all", *_runs(ctx)],
    ("dwells", "DWELLS"): _data,
    ("source", "RUN"): _data,
    ("sources", "RUN"): _data,
    ("fresh", "DWELLS2"): _data,
    ("units", "SN"): _units,
    ("serial", "SERIAL"): _units,
    ("serials", "SERIAL"): _units,
    ("effect", "NAME|random"): lambda ctx: ["random", *(scene.kind for scene in _scenes(ctx))],
    ("effect", "EFFECT"): _effects,
    ("effects", ""): _effects,
    ("remove", "EFFECT"): _effects,
    ("wanted", "EFFECT"): _effects,
    ("name", "PROFILE"): _of("stations.profile_files", "profile_names"),
    ("profile", "PROFILE"): _of("stations.profile_files", "profile_names"),
    ("device", "PRESET"): _of("stations.plant.preset", "preset_names"),
    ("fault", "KIND"): _of("stations.plant.faults.catalogue", "kinds"),
    ("form", ""): _of("pipelines.export", "FORMATS"),
    ("table", "TABLE"): lambda ctx: _archive(ctx).run(str(ctx.params.get("run") or "latest")).tables(),
    ("subject", "SUBJECT"): _of("pipelines.cli.plan_keys", "SUBJECTS"),
}
"""The source of candidates by the name of a parameter and a part of its notation, the narrower notation first."""
