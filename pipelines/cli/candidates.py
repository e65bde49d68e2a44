"""Candidates for the completion of a shell: runs, units, effects, recipes and the other names that a parameter takes.

A parameter gets its candidates by its name, so that a new command has them without an entry of its own. The shell completes the
names of files itself where there are none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import RunInfo
from schemas.errors import TumblelineError

if TYPE_CHECKING:
    from typer._click import Command, Context, Parameter


def attach(command: Command) -> Command:
    """The command, each parameter with its candidates."""
    for one in [command, *getattr(command, "commands", {}).values()]:
        for parameter in one.params:
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


def _infos(ctx: Context) -> list[RunInfo]:
    from pipelines.archive import Archive

    return Archive(ctx.params.get("archive")).runs()


def _runs(ctx: Context) -> list[str]:
    from pipelines.archive import Archive

    return ["latest", *Archive(ctx.params.get("archive")).run_ids()]


def _units(ctx: Context) -> list[str]:
    return [unit for info in _infos(ctx) for unit in info.units]


def _runs_and_units(ctx: Context) -> list[str]:
    infos = _infos(ctx)
    return ["latest", *(info.id for info in infos), *(unit for info in infos for unit in info.units)]


def _selections(ctx: Context) -> list[str]:
    return ["all", *_runs(ctx)]


def _recipes(ctx: Context) -> list[str]:
    from pipelines.jobs.recipes import recipe_names

    group = ctx.parent.command if ctx.parent is not None else None
    beside = getattr(group, "commands", {}) if getattr(group, "usual", "") else {}  # 'plan' alone is 'plan recipe'
    return [*recipe_names(), *beside, *_files("*.toml")]


def _limits(ctx: Context) -> list[str]:
    from pipelines.jobs.recipes import limits_names

    return [*limits_names(), *_files("*.toml")]


def _stations(ctx: Context) -> list[str]:
    from schemas.own_files import own_names
    from schemas.station import BUILT_IN

    return [BUILT_IN, *own_names("stations"), *_files("*.toml")]


def _effects(ctx: Context) -> list[str]:
    from inertial.effects import catalogue

    return list(catalogue())


def _effects_with_value(ctx: Context) -> list[str]:
    """The beginning of EFFECT=µg; the value has no candidates."""
    return [f"{name}=" for name in _effects(ctx)]


def _hidden(ctx: Context) -> list[str]:
    from pipelines.demo.scenes import SCENES

    return ["random", *(scene.kind for scene in SCENES)]


def _presets(ctx: Context) -> list[str]:
    from stations.plant.preset import preset_names

    return preset_names()


def _profiles(ctx: Context) -> list[str]:
    from stations.profile_files import profile_names

    return profile_names()


def _faults(ctx: Context) -> list[str]:
    from stations.plant.faults.catalogue import kinds

    return list(kinds())


def _formats(ctx: Context) -> list[str]:
    from pipelines.export import FORMATS

    return list(FORMATS)


def _tables(ctx: Context) -> list[str]:
    from pipelines.archive import Archive

    return Archive(ctx.params.get("archive")).run(str(ctx.params.get("run") or "latest")).tables()


def _subjects(ctx: Context) -> list[str]:
    from pipelines.cli.keys import SUBJECTS

    return list(SUBJECTS)


def _files(pattern: str) -> list[str]:
    """Files of the working folder; those of other folders are typed, or completed by the shell."""
    return [path.name for path in Path().glob(pattern)]


def _data(ctx: Context) -> list[str]:
    return [*_runs(ctx), *_files("*.parquet"), *_files("*.csv")]


SOURCES: dict[tuple[str, str], Callable[[Context], Iterable[str]]] = {
    ("recipe", "RECIPE"): _recipes,
    ("station", "FILE"): _stations,
    ("limits", "FILE"): _limits,
    ("run", "RUN|UNIT"): _runs_and_units,
    ("run", "RUN"): _runs,
    ("run_a", "RUN"): _runs,
    ("run_b", "RUN"): _runs,
    ("runs", "RUN"): _runs,
    ("calibration", "RUN"): _runs,
    ("names", "RUN|UNIT"): _runs_and_units,
    ("target", "UNIT|RUN"): _runs_and_units,
    ("selection", "SELECTION"): _selections,
    ("dwells", "DWELLS"): _data,
    ("data", "RUN"): _data,
    ("source", "RUN"): _data,
    ("fresh", "DWELLS2"): _data,
    ("units", "SN"): _units,
    ("serial", "SERIAL"): _units,
    ("effect", "NAME|random"): _hidden,
    ("effect", ""): _effects,
    ("effects", ""): _effects,
    ("remove", "EFFECT"): _effects,
    ("required_errors", "EFFECT="): _effects_with_value,
    ("see", ""): _effects,
    ("part", ""): _effects,
    ("name", "PROFILE"): _profiles,
    ("device", "PRESET"): _presets,
    ("fault", "KIND"): _faults,
    ("form", ""): _formats,
    ("table", "TABLE"): _tables,
    ("subject", "SUBJECT"): _subjects,
}
"""The source of candidates by the name of a parameter and a part of its notation, the narrower notation first."""
