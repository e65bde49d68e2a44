"""The parameters of the audit: computed from the coefficients of a unit, in the same unit for all units.

Misalignment has two parts: the non-orthogonality belongs to the unit (``square``: the angle between two axes minus 90°), the
rotation of the whole sensor to its seat (``rotation``). A new seating changes the second, not the
first (Geist 2017, NIST J. Res. 122.032: intrinsic parameters).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inertial.arrays import Array, Index
from schemas.units import AXES


class Family(NamedTuple):
    """Parameters of one kind and their unit of measure; ``of_unit``: they belong to the unit, not to its mounting."""

    unit: str
    names: tuple[str, ...]
    of_unit: bool


def _along(name: str) -> tuple[str, ...]:
    return tuple(f"{name}_{axis}" for axis in AXES)


FAMILIES: Mapping[str, Family] = {
    "bias": Family("µg", _along("bias"), of_unit=True),
    "scale": Family("ppm", _along("scale"), of_unit=True),
    "square": Family("mrad", ("square_yz", "square_zx", "square_xy"), of_unit=True),
    "rotation": Family("mrad", _along("rotation"), of_unit=False),
    "bias_temperature": Family("µg/K", _along("bias_temperature"), of_unit=True),
    "scale_temperature": Family("ppm/K", _along("scale_temperature"), of_unit=True),
}
NAMES: tuple[str, ...] = tuple(name for family in FAMILIES.values() for name in family.names)
FAMILY_OF = {name: family for family, content in FAMILIES.items() for name in content.names}


def unit_text(name: str) -> str:
    """The unit of a parameter."""
    return FAMILIES[FAMILY_OF[name]].unit


def parameter_text(name: str) -> str:
    """A parameter for people: ``bias over temperature, axis x``; a name that is none stays as it is."""
    family, axes = FAMILY_OF.get(name), name.rpartition("_")[2]
    if family is None:
        return name
    if family == "square":
        return f"angle between {axes[0]} and {axes[1]}"
    return f"rotation about {axes}" if family == "rotation" else f"{family.replace('_', ' over ')}, axis {axes}"


_CYCLE = ((1, 2), (2, 0), (0, 1))  # the two axes that a rotation about x, y, z mixes


def parameters_of(
    row: Index, texts: Mapping[str, tuple[Sequence[str], Index]], value: Array, error: Array, zero: Array
) -> dict[str, Array]:
    """Value and standard error of every parameter, each (n,): ``bias_x``, ``bias_x_error``, …; NaN where the model has none.

    ``scale`` stays in output units per g: parts per million need a nominal value, which only the population has.

    Parameters
    ----------
    row : (m,), of each coefficient the number of its calibration, from 0 to n - 1
    texts : columns ``effect``, ``name`` and ``axis``: the different texts, and (m,) the number of each coefficient's
    value, error : (m,)
    zero : (n,), nominal output at 0 g
    """
    nothing = np.full(zero.size, np.nan)

    def pick(*words: str) -> tuple[Array, Array]:
        columns = zip(texts.values(), words, strict=True)
        if not all(word in known for (known, _), word in columns):
            return nothing, nothing
        masks = [numbers == known.index(word) for (known, numbers), word in zip(texts.values(), words, strict=True)]
        chosen = np.flatnonzero(masks[0] & masks[1] & masks[2])
        value_and_error = nothing.copy(), nothing.copy()
        value_and_error[0][row[chosen]], value_and_error[1][row[chosen]] = value[chosen], error[chosen]
        return value_and_error

    scale = [pick("scale", "K1", axis) for axis in AXES]
    out: dict[str, Array] = {}
    for family, effect, coefficient in _SIMPLE:
        for (s, _), axis in zip(scale, AXES, strict=True):
            v, e = pick(effect, coefficient, axis)
            size = np.abs(s)
            _put(out, f"{family}_{axis}", 1e6 * (v - (zero if effect == "bias" else 0.0)) / size, 1e6 * e / size)
    for axis, (s, e) in zip(AXES, scale, strict=True):
        _put(out, f"scale_{axis}", s, e)
    for number, (j, k) in enumerate(_CYCLE):
        (a, a_error), (b, b_error) = (
            (1e3 * v / np.abs(scale[line][0]), 1e3 * e / np.abs(scale[line][0]))
            for line, (v, e) in (
                (j, pick("misalignment", f"K{AXES[j]}{AXES[k]}", AXES[j])),
                (k, pick("misalignment", f"K{AXES[k]}{AXES[j]}", AXES[k])),
            )
        )
        spread = np.hypot(a_error, b_error)
        _put(out, FAMILIES["square"].names[number], a + b, spread)
        _put(out, FAMILIES["rotation"].names[number], 0.5 * (b - a), 0.5 * spread)
    return out


_SIMPLE = (
    ("bias", "bias", "K0"),
    ("bias_temperature", "bias_temperature", "kT"),
    ("scale_temperature", "scale_temperature", "aT"),
)


def _put(out: dict[str, Array], name: str, value: Array, error: Array) -> None:
    out[name], out[f"{name}_error"] = value, error
