"""How a recognised recording is imported and fitted: the keys of the mapping, the fit, and the command that states them."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.quantities import FORCE_COLUMNS
from pipelines.importers import guesses, stretches
from pipelines.importers.content import Content
from pipelines.importers.named_columns import MEANING_OF
from pipelines.importers.stated_units import TEMPERATURE
from schemas.units import STANDARD_GRAVITY_M_S2

_FIRST = ("unit", "time", "x", "y", "z", "sd_x", "sd_y", "sd_z", "n", "force_x", "tilt", "temperature", "dwell")
MAPPED = tuple(dict.fromkeys((*_FIRST, *MEANING_OF.values())))
"""Meanings that a proposal maps, in their order."""
ASSUMED_HZ = 100.0
"""Rate of samples without a clock: it decides how long a stop is, and nothing else of a fit to its means."""
FEWEST_OF_NORM = 10
"""Positions for bias, scale and the angles between the axes, and one that judges."""
_APART = 0.02
"""Distance of positions over the radius of their sphere, about a degree, below which they are one."""
_BLOCKS, _SHORTEST_BLOCK_S = 60, 1.0
_UP = 0.9
"""Part of the size along an axis from which the face of a still record is known: 25° of a hand."""
_WARMS_C = 5.0
_KEYS = (
    "rows", "window_s", "shortest_s", "threshold", "join", "group", "gaps", "faulty", "positions", "face", "block_s",
    "local_gravity_m_s2",
)  # fmt: skip
"""Keys of a mapping with a value, in the order in which they are printed."""


@dataclass(frozen=True)
class Proposal:
    """Keys of the mapping of an import, and the fit (empty: none); what was assumed, and remarks; count of stops.

    places : number of positions that lie apart, up to what a fit needs
    """

    keys: dict[str, Any]
    fit: str = ""
    assumed: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    stops: int = 0
    places: int = 0

    def command(self, paths: Sequence[Path]) -> str:
        """The import as a line for a shell; a value that nothing states is in capitals."""
        words = ["tumbleline", "import", *(str(path) for path in paths)]
        words += ["--map", ",".join(f"{meaning}={name}" for meaning, name in self.keys["columns"].items())]
        words += ["--unit-of", ",".join(f"{what}={unit}" for what, unit in self.keys["units"].items())]
        words += [] if "unit" in self.keys["columns"] else ["--units", self.keys["unit"]]
        words += ["--rate", _text(self.keys["rate_hz"])] if "rate_hz" in self.keys else []
        poses = self.keys.get("poses", {})
        stated = {
            "axes": ",".join(self.keys.get("axes", ())),
            "poses": ",".join(f"{label}={face}" for label, face in poses.items()),
            **{key: _text(self.keys[key]) for key in _KEYS if key in self.keys},
        }
        words += [word for key, value in stated.items() if value for word in ("--set", f"{key}={value}")]
        words += ["--fit", self.fit] if self.fit else []
        return shlex.join(words)


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def columns_and_units(content: Content, guessed: guesses.Guesses, path: Path) -> dict[str, Any]:
    """Columns, units and serial number; COLUMN, UNIT and HZ where the file shows none."""
    names = list(guessed.columns)
    columns = {meaning: _mapped(column, names) for meaning in MAPPED if (column := guessed.column(meaning))}
    columns |= {axis: _mapped(column, names) for axis, column in guessed.few.items()}
    if not (guessed.single or guessed.few):
        columns |= {axis: "COLUMN" for axis in "xyz" if not guessed.column(axis)}
    units = {"output": guessed.output.meaning or "UNIT"}
    time = guessed.column("time")
    if time and guessed.time_unit.meaning and not (guessed.dwells and guessed.time_unit.meaning == "s"):
        units["time"] = guessed.time_unit.meaning
    elif time and not guessed.dwells and content.table[time].dtype.kind in "fiu":
        units["time"] = "UNIT"
    heat = TEMPERATURE.get(content.units.get(guessed.column("temperature"), "").strip().lower(), "degC")
    units |= {"temperature": heat} if heat != "degC" else {}
    keys: dict[str, Any] = {"columns": columns, "units": units, "unit": serial_of(path)}
    if guessed.single or guessed.few:
        keys["axes"] = sorted(guessed.few) or ["x"]
    if guessed.dwells:
        keys["rows"] = "dwells"
    elif not time:
        keys["rate_hz"] = "HZ" if content.interval_s is None else 1.0 / content.interval_s
    elif guessed.time_unit.meaning == "samples":
        keys["rate_hz"] = guesses.FINE_HZ
    return keys


def of_stops(keys: dict[str, Any], stops: stretches.Stops, levels: int) -> dict[str, Any]:
    """The keys with what finds the stops; ``levels``: positions logged back to back, above 1 where stops hold several."""
    if stops.several and levels > 1 and 2 * len(stops.several) >= len(stops.found):
        return keys | {"positions": levels}
    if not len(stops.found) or (stops.window_s == stretches.WINDOWS_S[0] and stops.threshold is None):
        return keys
    limit = {} if stops.threshold is None else {"threshold": stops.threshold}
    return keys | {"window_s": stops.window_s, "shortest_s": stops.window_s} | limit


def for_fit(
    keys: dict[str, Any],
    guessed: guesses.Guesses,
    means: Array | None,
    labels: Sequence[str],
    duration_s: float | None,
    heat: Array | None,
) -> Proposal:
    """The keys with all that a fit needs, and the fit.

    Parameters
    ----------
    keys : complete but for the rate of the samples and what the fit needs
    means, labels : (k, 3), outputs of the stops or positions, None where none were found; and what an import calls them
    duration_s : of the record; None: rows are positions
    heat : (n,), °C; None where none was recorded
    """
    assumed: list[str] = []
    if keys.get("rate_hz") == "HZ":
        keys = keys | {"rate_hz": ASSUMED_HZ}
        assumed.append(
            f"no clock: {ASSUMED_HZ:g} Hz assumed to find the stops; the coefficients do not depend on it (--rate HZ)"
        )
    if has_reference(keys):  # the import is fitted as a run is
        return Proposal(keys, "", tuple(assumed))
    gravity = (
        f"local gravity not stated: {STANDARD_GRAVITY_M_S2:.5f} m/s² taken; scale factors are relative to it "
        "(--set local_gravity_m_s2=M/S2)"
    )
    standard = {"local_gravity_m_s2": STANDARD_GRAVITY_M_S2}
    sphere = guessed.triad.sphere
    if sphere is not None and sphere.still and duration_s is not None:
        return _still(keys | standard, means, duration_s, heat, [*assumed, gravity])
    places = 0 if means is None else positions(means)
    if places >= FEWEST_OF_NORM:
        return Proposal(keys | standard, "norm", (*assumed, gravity))
    poses, askew = ({}, "") if means is None or sphere is None else _six_faces(means, labels, sphere.centre)
    if poses:
        told = "six faces taken as vertical: a tilt of 1° is 17 mg in the bias"
        return Proposal(keys | {"poses": poses} | standard, "faces", (*assumed, gravity, told))
    return Proposal(keys, "", tuple(assumed), (askew,) if askew else (), 0 if means is None else len(means), places)


def positions(means: Array) -> int:
    """Number of the stops (k, 3) that lie apart, at most as many as a fit needs: a repeated pose determines nothing new."""
    size = 0.5 * float(np.linalg.norm(np.ptp(means, axis=0)))
    apart: list[Array] = []
    for mean in means:
        if all(np.linalg.norm(mean - other) > _APART * size for other in apart):
            apart.append(mean)
        if len(apart) == FEWEST_OF_NORM:
            break
    return len(apart)


def has_reference(keys: dict[str, Any]) -> bool:
    """Whether the pose of every dwell is known: by the face that is up, its force, or angles; of few axes by one."""
    known = (FORCE_COLUMNS, ("outer", "inner"), *([("tilt",), ("force_x",)] if "axes" in keys else []))
    return "face" in keys or any(set(names) <= set(keys["columns"]) for names in known)


def _six_faces(means: Array, labels: Sequence[str], centre: Array) -> tuple[dict[str, str], str]:
    """Label of a dwell → face that is up, where each of six faces is up once; else which of them lean too far, in words."""
    along = (means - centre) / np.linalg.norm(means - centre, axis=1, keepdims=True)
    axes = np.argmax(np.abs(along), axis=1)
    faces = [f"{'+' if row[k] > 0.0 else '-'}{'xyz'[k]}" for row, k in zip(along, axes.tolist(), strict=True)]
    if not len(faces) == len(set(faces)) == len(set(labels)) == 6 or any(re.search(r"[,=]", label) for label in labels):
        return {}, ""
    upright = np.abs(along).max(axis=1)
    lean = [
        f"{face} by {np.degrees(np.arccos(cosine)):.0f}°"
        for face, cosine in zip(faces, upright.tolist(), strict=True)
        if cosine <= _UP
    ]
    if lean:
        limit = np.degrees(np.arccos(_UP))
        return (
            {},
            f"of six faces these lean by more than {limit:.0f}°: {', '.join(lean)}; stand them against a right angle",
        )
    return dict(zip(labels, faces, strict=True)), ""


def _still(
    keys: dict[str, Any], means: Array | None, duration_s: float, heat: Array | None, assumed: list[str]
) -> Proposal:
    """Blocks of a record in one pose with the face that is up, which is known where the output is an acceleration."""
    size = 0.0 if means is None else float(np.linalg.norm(means.mean(axis=0)))
    if means is None or not size > 0.0 or keys["units"]["output"] not in {"g", "mg", "m/s^2"}:
        return Proposal(keys, "", tuple(assumed))
    along = means.mean(axis=0) / size
    axis = int(np.argmax(np.abs(along)))
    if abs(along[axis]) < _UP:
        return Proposal(keys, "", tuple(assumed))
    face = f"{'+' if along[axis] > 0.0 else '-'}{'xyz'[axis]}"
    block = max(_SHORTEST_BLOCK_S, float(f"{duration_s / _BLOCKS:.1g}"))
    tilt = f"one pose, {face} taken as vertical: the bias of the other axes holds the tilt of the surface (1° is 17 mg)"
    searched = {"window_s", "shortest_s", "threshold", "positions"}
    keys = {key: value for key, value in keys.items() if key not in searched}
    warm = heat is not None and float(np.ptp(heat[np.isfinite(heat)])) > _WARMS_C
    remark = () if warm else ("temperature does not change: only bias, noise and drift can be seen",)
    return Proposal(keys | {"face": face, "block_s": block}, "", (*assumed, tilt), remark)


def serial_of(path: Path) -> str:
    """A serial number from the name of a file."""
    stem = re.sub(r"[^A-Za-z0-9._+-]", "-", path.name.split(".")[0]).strip("._+-")
    return stem[:64] or "UNIT-1"


def _mapped(name: str, names: list[str]) -> str:
    """A column as a name for --map: by its number where its name has a comma or an equals sign, or blanks at its ends."""
    return str(names.index(name) + 1) if re.search(r"[,=]|^\s|\s$", name) or not name else name
