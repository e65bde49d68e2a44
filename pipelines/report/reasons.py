"""Reasons of units that did not pass: those of one kind together, each unit with its own value."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pipelines.stages.figures import plain_reason

_VALUE = re.compile(r"(?P<before>.*?)(?P<value>[-\d.e+]+(?: ± [-\d.e+]+)?(?: [^\s,]+)?), (?P<limit>limit [^,;:]+)")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass
class ReasonGroup:
    """A reason with its limit, and the units that it concerns, each with its value; no value where the text says all."""

    text: str
    units: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])

    @property
    def sentence(self) -> str:
        """The reason with its units for people."""
        named = ", ".join(f"{unit} ({value})" if value else unit for unit, value in self.units)
        return f"{self.text}: {named}" if len(self.units) > 1 or self.units[0][1] else f"{named}: {self.text}"


def grouped_reasons(rows: Iterable[Mapping[str, Any]]) -> list[ReasonGroup]:
    """The reasons of units with ``unit``, ``outcome`` and ``reasons``; what concerns most units first."""
    kinds: dict[str, list[tuple[str, str, str]]] = {}
    for row in rows:
        text = str(row["reasons"] or "")
        # a refusal is one text, with its remedy behind a semicolon
        for reason in filter(None, [text] if row["outcome"] == "refused" else text.split("; ")):
            plain = plain_reason(reason)
            found = _VALUE.match(plain)
            told = plain if found is None else f"{found['before'].rstrip(' ,:')}, {found['limit']}"
            kinds.setdefault(_NUMBER.sub("#", told), []).append(
                (str(row["unit"]), told, found["value"] if found else "")
            )
    groups = [_group(members) for members in kinds.values()]
    return sorted(groups, key=lambda group: -len(group.units))


def _group(members: list[tuple[str, str, str]]) -> ReasonGroup:
    """Reasons that differ in numbers alone: those in which they differ stand with the units."""
    numbers = [_NUMBER.findall(told) for _, told, _ in members]
    differ = [len(set(column)) > 1 for column in zip(*numbers, strict=True)]
    open_, first = iter(differ), members[0][1]
    text = _NUMBER.sub(lambda number: "…" if next(open_) else number[0], first)
    varying = [", ".join(value for value, apart in zip(row, differ, strict=True) if apart) for row in numbers]
    return ReasonGroup(text, [(unit, value or other) for (unit, _, value), other in zip(members, varying, strict=True)])
