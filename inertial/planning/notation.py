"""Symbols and terms of an effect's equation for one axis and column, as text."""

import re

from inertial.effects import SensorEffect
from inertial.effects.base import AXES, AnyEffect, others


def symbol(effect: AnyEffect, column: int | None = None) -> str:
    """Symbol of an effect, or of one of its columns where each has its own."""
    each = [part.strip() for part in effect.symbol.split(",")]
    if column is not None and len(each) > column and isinstance(effect, SensorEffect) and len(each) > 1:
        return each[column]
    return ", ".join(each)


def factor_text(effect: AnyEffect, axis: int, column: int) -> str:
    """The factor that one coefficient of an effect multiplies, with the letters of the axes: ``fx·fy``, ``θ²``, ``dT/dt``."""
    if "=" in effect.equation or not isinstance(effect, SensorEffect):
        return f"the column of {effect.id}"
    symbols = [part.strip() for part in effect.symbol.split(",")]
    factors = _factors(re.split(r"[,;] (?![^(]*\))", effect.equation)[0], symbols, column)
    if not factors:
        return f"the column of {effect.id}"
    text = "·".join(factors)
    if text.startswith("(") and text.endswith(")") and len(factors) == 1:
        text = text[1:-1]
    return _lettered(text, axis)


def _factors(terms_text: str, symbols: list[str], column: int) -> list[str]:
    """Factors beside the coefficient in one term of a sum; brackets that contain coefficients are expanded."""
    terms = [t for t in _split(terms_text, "+") if any(s in t for s in symbols)] or [terms_text]
    factors: list[str] = []
    for factor in _split(terms[column] if column < len(terms) else terms[0], "·"):
        if _holds(factor, symbols):
            continue
        opened = factor.startswith("(") and factor.endswith(")") and any(s in factor for s in symbols)
        factors += _factors(factor[1:-1], symbols, column) if opened else [factor]
    return factors


def _split(text: str, sign: str) -> list[str]:
    """Parts of a text, split at a sign outside brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += {"(": 1, ")": -1}.get(letter, 0)
        if letter == sign and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [p.strip() for p in parts]


def _holds(factor: str, symbols: list[str]) -> bool:
    """Whether a factor is a coefficient: one of the symbols, alone or with a number."""
    bare = factor.lstrip("½−-").strip()
    return any(re.fullmatch(rf"{re.escape(s)}\w?", bare) for s in symbols)


def _lettered(text: str, axis: int) -> str:
    """The text with the standard's axis indices i, p, o replaced by the letters of the axes."""
    next_axis, other = others(axis)
    letters = {"i": AXES[axis], "p": AXES[next_axis], "j": AXES[next_axis], "o": AXES[other], "k": AXES[other]}
    return re.sub(r"f([ipojk])(?![A-Za-z_])", lambda m: f"f{letters[m.group(1)]}", text)
