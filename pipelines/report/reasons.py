"""Reasons of units that did not pass: those of one kind together, each unit with its own value."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pipelines.report.templates import plain_reason

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
    groups: dict[str, ReasonGroup] = {}
    for row in rows:
        text = str(row["reasons"] or "")
        # a refusal is one text, with its remedy behind a semicolon
        for reason in [text] if row["outcome"] == "refused" else text.split("; "):
            if reason:
                plain = plain_reason(reason)
                found = _VALUE.match(plain)
                told = plain if found is None else f"{found['before'].rstrip(' ,:')}, {found['limit']}"
                group = groups.setdefault(_NUMBER.sub("#", told), ReasonGroup(told))
                group.units.append((str(row["unit"]), "" if found is None else found["value"]))
    return sorted(groups.values(), key=lambda group: -len(group.units))
