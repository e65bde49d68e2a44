"""Files of the user beside the built-in ones, by name: recipes, limits, stations, profiles and presets.

A name is searched in the folder of its kind in the working folder (``recipes/NAME.toml``), and then in that of the user
(``$XDG_CONFIG_HOME/tumbleline/recipes/NAME.toml``; XDG Base Directory Specification 0.8, by default ``~/.config``). A file with
the name of a built-in one is refused, because the name would have different contents for different users. Where both folders have
the name with different contents, a message names the file that is used and the other one, in workers too.
"""

import os
from collections.abc import Callable, Iterable
from hashlib import sha256
from pathlib import Path
from typing import Literal, get_args

from schemas.errors import RecipeInvalid
from schemas.foreign import is_file
from schemas.log_lines import tell

Kind = Literal["recipes", "limits", "stations", "profiles", "presets"]
KINDS: tuple[Kind, ...] = get_args(Kind)
SUFFIX = ".toml"

_listeners: list[Callable[[str], None]] = []
_reported: set[Path] = set()
_told: set[tuple[Path, Path]] = set()


def folders(kind: Kind) -> list[Path]:
    """The folders that are searched for files of a kind, in order: that of the working folder, that of the user."""
    config = os.environ.get("XDG_CONFIG_HOME", "")
    if not Path(config).is_absolute():  # the specification: a relative path is invalid and ignored
        config = str(Path.home() / ".config")
    return [Path(kind), Path(config) / "tumbleline" / kind]


def own_files(kind: Kind) -> dict[str, Path]:
    """The user's files of a kind by their names, sorted; of two with one name that of the working folder."""
    paths = {path.stem: path for folder in reversed(folders(kind)) for path in folder.glob(f"*{SUFFIX}")}
    return dict(sorted(paths.items()))


def own_file(kind: Kind, name: str, built_in: Iterable[str] = ()) -> Path | None:
    """The file of the user with this name; None where there is none, and refused where it is among the ``built_in`` names."""
    if not name or Path(name).name != name or name.startswith("."):
        return None
    there = [path for folder in folders(kind) if is_file(path := folder / f"{name}{SUFFIX}")]
    if not there:
        return None
    refuse_built_in_name(kind, name, there[0], built_in)
    _report(kind, name, there)
    return there[0]


def refuse_built_in_name(kind: Kind, name: str, path: Path, built_in: Iterable[str]) -> None:
    """Refuse, as :class:`RecipeInvalid`, a file that would silently replace a built-in file of its name."""
    if name in built_in:
        raise RecipeInvalid(
            f"{kind}: '{name}' is built in, and {path} has the same name, one file per name is needed; rename {path}"
        )


def contents(named: Iterable[tuple[Kind, str]]) -> dict[str, str]:
    """SHA-256 of the named files that are the user's, by ``kind/name``; built-in files belong to the product's version."""
    paths = {(kind, name): own_file(kind, name) for kind, name in named}
    return {
        f"{kind}/{name}": sha256(path.read_bytes()).hexdigest()
        for (kind, name), path in sorted(paths.items())
        if path is not None
    }


def report_to(listener: Callable[[str], None]) -> None:
    """Call ``listener``, instead of any earlier one, with a line for each file of the user that is used, at its first use."""
    _listeners[:] = [listener]
    _reported.clear()


def _report(kind: Kind, name: str, there: list[Path]) -> None:
    """Tell which file is used, and of others of the same name that have other content; each once in a process."""
    if there[0] not in _reported and _listeners:
        _reported.add(there[0])
        _listeners[0](f"{kind.removesuffix('s') if kind != 'limits' else kind} '{name}': {there[0]}")
    used = there[0].resolve()
    for other in there[1:]:
        if (used, other) not in _told and other.read_bytes() != used.read_bytes():
            _told.add((used, other))
            tell(f"{kind}: '{name}' is {used}; {other} has other content and is not used", level="warning")
