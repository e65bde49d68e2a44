"""Reasons of a decision for readers: names of figures as words; what is stored keeps the ids."""

from __future__ import annotations

import re

from pipelines.stages.figures import FIGURES


def plain_reason(text: str) -> str:
    """One reason, or several divided by ``; ``, in which a figure has its label instead of its id."""
    return "; ".join(_plain(part) for part in text.split("; "))


def _plain(part: str) -> str:
    begin = re.match(r"\w+", part)
    known = FIGURES.get(begin.group()) if begin else None
    if begin is None or known is None:
        return part
    rest = part[begin.end() :]
    return f"{known.label[:1].upper()}{known.label[1:]}{'' if rest.startswith(':') else ':'}{rest}"
