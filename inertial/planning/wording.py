"""The term of an effect's equation for one axis and column, and its symbol, for sentences."""

import re

from inertial.effects import SensorEffect
from inertial.effects.base import AXES, AnyEffect, others


def symbol(effect: AnyEffect, column: int | None = None) -> str:
    """Symbol of an effect, or of one of its columns where each has its own."""
    each = [part.strip() for part in effect.symbol.split(",")]
    if column is not None and len(each) > column and isinstance(effect, SensorEffect) and len(each) > 1:
        return each[column]
    return ", ".join(each)


def signature(effect: AnyEffect, axis: int, column: int) -> str:
    """What one coefficient of an effect multiplies, with the axes' letters in it: ``fx·fy``, ``θ²``, ``dT/dt``."""
    if "=" in effect.equation or not isinstance(effect, SensorEffect):
        return f"the signature of {effect.id}"
    symbols = [part.strip() for part in effect.symbol.split(",")]
    factors = _factors(re.split(r"[,;] (?![^(]*\))", effect.equation)[0], symbols, column)
    if not factors:
        return f"the signature of {effect.id}"
    text = "·".join(factors)
    if text.startswith("(") and text.endswith(")") and len(factors) == 1:
        text = text[1:-1]
    return _lettered(text, axis)


def _factors(sum_: str, symbols: list[str], column: int) -> list[str]:
    """Factors beside the coefficient in one term of a sum; sums in brackets that hold coefficients are opened."""
    terms = [t for t in _split(sum_, "+") if any(s in t for s in symbols)] or [sum_]
    found: list[str] = []
    for factor in _split(terms[column] if column < len(terms) else terms[0], "·"):
        if _holds(factor, symbols):
            continue
        opened = factor.startswith("(") and factor.endswith(")") and any(s in factor for s in symbols)
        found += _factors(factor[1:-1], symbols, column) if opened else [factor]
    return found


def _split(text: str, sign: str) -> list[str]:
    """Parts of a text between the signs that stand outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if letter == sign and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [p.strip() for p in parts]


def _holds(factor: str, symbols: list[str]) -> bool:
    """Whether a factor is a coefficient: one of the symbols, alone, numbered or with others in brackets."""
    bare = factor.lstrip("½−-").strip()
    return any(re.fullmatch(rf"{re.escape(s)}\w?", bare) for s in symbols)


def _lettered(text: str, axis: int) -> str:
    """The names of the standard for own, next and other axis as letters of the fixture's axes."""
    next_axis, other = others(axis)
    letters = {"i": AXES[axis], "p": AXES[next_axis], "j": AXES[next_axis], "o": AXES[other], "k": AXES[other]}
    return re.sub(r"f([ipojk])(?![A-Za-z_])", lambda m: f"f{letters[m.group(1)]}", text)
