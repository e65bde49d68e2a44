"""Which three columns of an unknown file are the outputs of one accelerometer; none is better than a wrong three.

At rest the three outputs of an accelerometer lie on a sphere about its bias, and they move on it when the sensor is turned.
Another quantity does not: a gyroscope returns to its centre, a temperature stays on a line, two sensors have two spheres.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array
from inertial.static_intervals import moving_variance
from pipelines.importers import unit_check
from pipelines.importers.stated_units import TEMPERATURE, output_unit

REFERENCE = re.compile(
    r"^(?:(?:force|ref|true|applied|expected|nominal|g)(?:[_ ]?in)?(?:[_ .].*)?"
    r"|[xyz?][_ .](?:force|ref|reference|true|applied|expected|nominal)(?:[_ .(\[].*)?)$",
    re.IGNORECASE,
)
"""Names of what a sensor should read; never an output."""
OTHER = re.compile(
    r"gyr|rot|omega|rate|angvel|mag|quat|angle|roll|pitch|yaw|euler|tilt|^sd|std|var|err|lux|uv|press|baro|hum|volt|batt|"
    r"linear|grav|user|vel|pos|min|max|peak|^w[_ .]?[xyz?]|^m[_ .]?[xyz?]$|dps|deg",
    re.IGNORECASE,
)
"""Names of other quantities: also of accelerations without gravity, and of gravity as a phone computes it."""
HEAT = re.compile(r"temp|heat|^t_?c$|degc|°c|thermo|^t\d?$", re.IGNORECASE)
COUNT = re.compile(r"sample|index|count|number|^n$|^no\.?$|^#|window|row|packet|^id$", re.IGNORECASE)
_NAMED = re.compile(r"acc|^a[_ .]?\?|\ba\?|imu\?", re.IGNORECASE)
_FOREIGN_UNIT = re.compile(r"rad|deg|dps|°|gauss|tesla|^[uµmn]?t$|pa$|hz|%", re.IGNORECASE)
_OF_MATRIX = re.compile(r"^.*_(?=\d+$)")
_PARTS, _LONGEST_PART, _FEW_ROWS = 150, 50, 300
_QUIET = 3.0
"""Times the scatter of the quietest tenth of the parts, up to which a part is at rest."""
_MISFIT = 0.04
"""Rms distance of the parts from the sphere over its radius: scale factors differ by some per cent, and hands shake."""
_MOVES, _STILL = 0.6, 0.2
"""Range of an axis over the radius from which it moves, and below which it does not."""
_LEFT_OUT = 0.1
_CLOSE = 0.1
"""Relative distance of the radius from gravity in a unit, at which a triad without a name for acceleration is one."""
_EXACT = 1e-3
"""Range of the size over it, up to which three columns may be the force of a table: its numbers have three decimals or more."""
_CLEAR_COUNTS, _CLEAR_RATIO = 250.0, 30.0
"""Size of whole numbers at rest, and over their scatter: the bias of a gyroscope is smaller."""
_MOST = 60
_JUMP = 0.2
_CELL, _FEWEST_CELLS = 0.1, 5
"""Size of a place over the range of the parts; places that a sphere needs: it has four numbers."""


@dataclass(frozen=True)
class Sphere:
    """The sphere on which the parts at rest lie.

    radius : output unit · centre : (3,) · misfit : rms distance over the radius · spans : (3,) ranges over it, largest last
    jumps : median distance of neighbouring rows over the radius
    """

    radius: float
    centre: Array
    misfit: float
    spans: Array
    jumps: float

    @property
    def fits(self) -> bool:
        """Whether the parts lie on it and move in two axes at least."""
        return self.misfit < _MISFIT and self.spans[1] > _MOVES

    @property
    def still(self) -> bool:
        """Whether the record is in one pose."""
        return bool(self.spans[2] < _STILL)

    @property
    def gravity(self) -> str:
        """The unit in which the radius, or the size of one pose, is that of gravity; empty for counts and volts."""
        close = (u for u, gravity in unit_check.GRAVITY.items() if abs(self.radius / gravity - 1.0) < _CLOSE)
        return next(close, "")


@dataclass(frozen=True)
class Triad:
    """Three columns for x, y, z (none where ``names`` is empty), the reason, and what was seen of them.

    doubt : why none of several is proposed; empty otherwise
    """

    names: tuple[str, ...] = ()
    reason: str = ""
    sphere: Sphere | None = None
    doubt: str = ""

    def __bool__(self) -> bool:
        return bool(self.names)


def triad(columns: Mapping[str, Array], units: Mapping[str, str]) -> Triad:
    """The outputs of the accelerometer of a file.

    Parameters
    ----------
    columns : numbers of each column that may be one, (n,), without time and row numbers; NaN where there is none
    units : as the file states them
    """
    live = [name for name in columns if may_be_output(name, units.get(name, "")) and _changes(columns[name])][:_MOST]
    groups = dict(_lettered([name for name in columns if np.isfinite(columns[name]).any()][:_MOST]))
    of_other = {name for stem, names in groups.items() for name in names if OTHER.search(stem)}
    usable = {stem: names for stem, names in groups.items() if all(name in live for name in names)}
    stated = {
        stem: names
        for stem, names in usable.items()
        if _NAMED.search(stem) or output_unit(units.get(names[0], "")) in {"g", "mg", "m/s^2"}
    }
    spheres = {names: sphere for names in usable.values() if (sphere := sphere_of(columns, names)) is not None}
    found = [(names, spheres[names]) for names in stated.values() if names in spheres]
    plain = [(names, sphere) for names, sphere in spheres.items() if not OTHER.search("".join(names))]
    if found:
        beside = [pair for pair in plain if pair not in found and pair[1].fits] if _is_exact(columns, *found) else []
        return _one_of(found + beside, "its name")
    if stated:
        return Triad()
    fits = [(names, sphere) for names, sphere in plain if _shows_gravity(sphere, columns, names)]
    if fits:
        return _one_of(fits, "its name, and its size is that of gravity")
    dead = [names for names in groups.values() if _one_is_dead(columns, names, live)]
    if len(dead) == 1:
        return Triad(dead[0], "its name, though one of the three never changes", sphere_of(columns, dead[0]))
    free = [name for name in live if name not in of_other and not any(name in names for names in usable.values())]
    return _unnamed(columns, free, units)


def _is_exact(columns: Mapping[str, Array], *found: tuple[tuple[str, ...], Sphere]) -> bool:
    """Whether the only triad has one size in each of its poses, as the force of a table has, but hardly an output."""
    size = np.linalg.norm(np.column_stack([columns[name] for name in found[0][0]]), axis=1)
    return len(found) == 1 and found[0][1].fits and bool(np.ptp(size) < _EXACT * np.mean(size))


def _unnamed(columns: Mapping[str, Array], free: Sequence[str], units: Mapping[str, str]) -> Triad:
    """Three neighbouring columns without names for axes: they have to lie on a sphere, and to move on it in every axis."""
    order = list(columns)
    seen: list[tuple[tuple[str, ...], Sphere]] = []
    for names in zip(free, free[1:], free[2:], strict=False):
        beside = order.index(names[2]) - order.index(names[0]) == 2
        if not beside or len({units.get(name, "") for name in names}) > 1:
            continue
        sphere = sphere_of(columns, names)
        if sphere is not None and sphere.fits and sphere.spans[0] > _MOVES:
            seen.append((names, sphere))
    sized = [pair for pair in seen if pair[1].gravity]
    return _one_of(sized or seen, "three columns that move on a sphere at rest, as gravity does")


def _one_of(found: Sequence[tuple[tuple[str, ...], Sphere]], reason: str) -> Triad:
    """The only triad there is; of several none, with the doubt."""
    if len(found) == 1:
        names, sphere = found[0]
        return Triad(names, reason, sphere)
    if not found:
        return Triad()
    listed = "; ".join(", ".join(names) for names, _ in found[:4])
    return Triad(
        sphere=found[0][1] if all(sphere.fits for _, sphere in found) else None,
        doubt=f"{len(found)} groups of three columns may be an accelerometer ({listed}): choose one with --map",
    )


def sphere_of(columns: Mapping[str, Array], names: Sequence[str]) -> Sphere | None:
    """The sphere of three columns; None where there are too few numbers."""
    output = np.column_stack([columns[name] for name in names])
    output = output[np.isfinite(output).all(axis=1)]
    if len(output) < 2:
        return None
    bits = unit_check.unsigned_bits(output)
    signed = np.where(output >= 2.0 ** (bits - 1), output - 2.0**bits, output) if bits else output
    return _fitted(_parts(signed), signed)


def _parts(output: Array) -> Array:
    """Means (k, 3) of the parts of a record that are at rest; its rows where they are few."""
    if len(output) <= _FEW_ROWS:
        return output
    width = int(np.clip(len(output) // _PARTS, 5, _LONGEST_PART))
    scatter = np.sqrt(moving_variance(output, width).sum(axis=-1))[::width]
    means = output[: len(output) // width * width].reshape(-1, width, 3).mean(axis=1)
    scatter = scatter[: len(means)]
    quiet = scatter <= _QUIET * np.quantile(scatter, 0.1) + 1e-12 * float(np.abs(output).max())
    return means[: len(scatter)][quiet]


def _fitted(parts: Array, output: Array) -> Sphere:
    """Least squares of |p − c|² = r² over the parts, without the tenth that is furthest: hands shake there."""
    size = float(np.median(np.linalg.norm(parts, axis=1)))
    jumps = float(np.median(np.linalg.norm(np.diff(output, axis=0), axis=1)))
    spans = np.ptp(parts, axis=0)
    # or far from zero, as the counts of a converter with its zero in the middle
    one_pose = np.max(spans) < _STILL * size
    pose = Sphere(max(size, 1e-300), np.zeros(3), np.inf, np.sort(spans) / max(size, 1e-300), jumps / max(size, 1e-300))
    if not np.max(spans) > 0.0:
        return pose
    parts = _cell_means(parts, _CELL * float(np.max(spans)))
    if len(parts) < _FEWEST_CELLS:
        return pose
    unit, middle, used = float(np.max(spans)), parts.mean(axis=0), parts
    centre, radius, away = middle, size, np.zeros(len(parts))
    for _ in range(3):
        p = (used - middle) / unit
        solved = np.linalg.lstsq(np.column_stack([2.0 * p, np.ones(len(p))]), np.sum(p**2, axis=1), rcond=1e-2)[0]
        centre = middle + unit * solved[:3]
        radius = unit * float(np.sqrt(max(solved[3] + np.sum(solved[:3] ** 2), 1e-12)))
        away = np.abs(np.linalg.norm(parts - centre, axis=1) - radius)
        used = parts[away <= np.quantile(away, 1.0 - _LEFT_OUT)]
    nearest = np.sort(away)[: max(4, int(np.ceil((1.0 - _LEFT_OUT) * len(away))))]
    misfit = float(np.sqrt(np.mean(nearest**2))) / radius
    found = Sphere(radius, centre, misfit, np.sort(np.ptp(used, axis=0)) / radius, jumps / radius)
    if found.fits and (found.spans[0] > 1.0 or not one_pose):
        return found
    return replace(pose, misfit=misfit)


def _cell_means(parts: Array, size: float) -> Array:
    """Mean (k, 3) of the parts in each cell of the grid that has some, so that long rests in a cell do not decide."""
    cells = np.unique(np.rint((parts - parts.min(axis=0)) / size), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(cells)
    return np.stack([np.bincount(cells, weights=parts[:, k]) / count for k in range(3)], axis=1)


def references(columns: Mapping[str, Array]) -> tuple[str, ...]:
    """The three columns with the force that acts on x, y, z, in g: called a reference, and of the size of gravity in each row."""
    for stem, names in _lettered([*columns]):
        if REFERENCE.match(stem):
            size = np.linalg.norm(np.column_stack([columns[name] for name in names]), axis=1)
            if np.all(np.abs(size - 1.0) < _CLOSE):
                return names
    return ()


def _shows_gravity(sphere: Sphere, columns: Mapping[str, Array], names: Sequence[str]) -> bool:
    """Whether columns that are only called x, y, z read gravity: on a sphere, or in one pose with a size that is no bias."""
    if sphere.fits:
        return True
    if not sphere.still:
        return len(columns[names[0]]) < 7 and bool(unit_check.looks_like(sphere.radius))
    output = np.column_stack([columns[name] for name in names])
    integers = bool(np.all(output[:1000] == np.rint(output[:1000])))
    clear = sphere.radius > max(_CLEAR_COUNTS, _CLEAR_RATIO * float(np.linalg.norm(np.nanstd(output, axis=0))))
    return bool(sphere.gravity) or (integers and clear)


def _lettered(names: Sequence[str]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Three names that differ in one letter, x, y, z, with what they share: ``acc_?`` and acc_x, acc_y, acc_z.

    The elements 0, 1, 2 of an array of three are such names, too.
    """
    known = set(names)
    for name in names:
        stem = name.removesuffix("[0]")
        if stem != name and known.issuperset({f"{stem}[1]", f"{stem}[2]"}) and f"{stem}[3]" not in known:
            yield f"{stem}[?]", (name, f"{stem}[1]", f"{stem}[2]")
        for index in (k for k, letter in enumerate(name) if letter in "xX"):
            letters = "xyz" if name[index] == "x" else "XYZ"
            three = tuple(name[:index] + letter + name[index + 1 :] for letter in letters)
            if known.issuperset(three):
                yield name[:index] + "?" + name[index + 1 :], three
                break


def may_be_output(name: str, unit: str) -> bool:
    """Whether name and unit allow an output of an accelerometer."""
    stated = bool(output_unit(unit))
    if unit and not stated and (_FOREIGN_UNIT.search(unit) or TEMPERATURE.get(unit.strip().lower())):
        return False
    if REFERENCE.match(name):
        return False
    plain = _OF_MATRIX.sub("", name)  # the name of a matrix is that of all its columns
    return not ((OTHER.search(name) and not stated) or HEAT.search(plain) or (COUNT.search(plain) and not stated))


def _changes(numbers: Array) -> bool:
    there = numbers[np.isfinite(numbers)]
    return there.size > 1 and bool(np.ptp(there) > 0.0)


def _one_is_dead(columns: Mapping[str, Array], names: Sequence[str], live: Sequence[str]) -> bool:
    """Whether two of three axes move by as much as each other, and the third never changes."""
    moving = [float(np.nanmax(columns[name]) - np.nanmin(columns[name])) for name in names if name in live]
    still = sum(not _changes(columns[name]) for name in names)
    return len(moving) == 2 and still == 1 and min(moving) > _MOVES * max(moving) and not OTHER.search("".join(names))


def is_row_number(numbers: Array) -> bool:
    """Whether a column numbers the rows: from 0 or from 1."""
    return numbers.size > 2 and numbers[0] in {0.0, 1.0} and bool(np.all(np.diff(numbers) == 1.0))


def are_positions(sphere: Sphere | None, rows: int) -> bool:
    """Whether neighbouring rows are so far apart that each is a separate position, not a sample of a record."""
    return sphere is not None and rows <= _FEW_ROWS and sphere.fits and sphere.jumps > _JUMP
