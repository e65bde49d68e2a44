"""Separators of thousands in a text of numbers: 16,384 · 16.384,5 · 16'384 · 16 384. They are taken out before the text is read.

A comma or a point may also be the decimal sign, and 16,384 read as 16.384 gives a record that looks sound. A separator is
therefore taken only where the text shows that it is one; elsewhere it stays the decimal sign.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from pipelines.importers.text_layout import fields_of, is_comment, is_number

_SURE = ("'", "\N{RIGHT SINGLE QUOTATION MARK}", "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}", "\N{THIN SPACE}")
"""Signs that stand in no number for anything else."""
_NAMES = {",": "a comma", ".": "a point", "'": "an apostrophe", _SURE[1]: "an apostrophe"}
_DIVIDERS = (";", "\t", "|", ",")
_SAMPLE = 400
_ALIKE = 0.9
_MANY = 20
"""Numbers with a sign from which on their form shows that it groups digits: three behind each sign, never a leading zero, and in
the same column whole numbers without it, all below a thousand."""


def without_thousands(lines: Sequence[str]) -> tuple[Sequence[str], str]:
    """Lines with their numbers without separators of thousands, and a remark; the lines as they are where there are none."""
    later = lines[len(lines) // 3 :]
    sample = [line for line in later[:: max(1, len(later) // _SAMPLE)] if not is_comment(line)]
    divider = _divider(sample)
    if not divider:
        return lines, ""
    rows = [fields_of(line, divider) for line in sample]
    for sign in (*_SURE, " ", ",", "."):
        if not _is_separator(sign, rows):
            continue
        grouped = _grouped(sign)
        cleaned = [_cleaned(line, divider, sign, grouped) for line in lines]
        return cleaned, f"numbers with {_NAMES.get(sign, 'a space')} between thousands"
    return lines, ""


def _divider(sample: Sequence[str]) -> str:
    """The divider of lines that have more than one field; empty if there is none but blanks."""
    for divider in _DIVIDERS:
        often = Counter(len(fields_of(line, divider)) for line in sample).most_common(1)
        if often and often[0][0] > 1 and often[0][1] >= _ALIKE * len(sample):
            return divider
    return ""


def _grouped(sign: str) -> re.Pattern[str]:
    """The form of a number with separators, decimals included."""
    decimal = {",": r"\.", ".": ","}.get(sign, "[.,]")
    return re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:{re.escape(sign)}\d{{3}})+(?:{decimal}\d+)?")


def _is_separator(sign: str, rows: Sequence[Sequence[str]]) -> bool:
    """Whether a sign groups digits in all words that have it between digits."""
    words = [word for row in rows for word in row]
    own = [word for word in words if re.search(rf"\d{re.escape(sign)}\d", word)]
    grouped = _grouped(sign)
    if not own or not all(grouped.fullmatch(word) for word in own):
        return False
    if sign not in {",", "."}:
        return True
    other = "." if sign == "," else ","
    if any(other in word or word.count(sign) > 1 for word in own):
        return True
    if any(other in word and is_number(word, other) for word in words):
        return True  # the decimal sign of this text is the other one
    return len(own) >= _MANY and any(
        _mixed([row[k] for row in rows if k < len(row)], grouped) for k in range(max(map(len, rows)))
    )


def _mixed(column: Sequence[str], grouped: re.Pattern[str]) -> bool:
    """Whether a column has grouped numbers, and whole numbers, which are all below a thousand."""
    whole = [abs(int(word)) for word in column if re.fullmatch(r"[+-]?\d{1,12}", word)]
    return any(whole) and max(whole) < 1000 and any(grouped.fullmatch(word) for word in column)


def _cleaned(line: str, divider: str, sign: str, grouped: re.Pattern[str]) -> str:
    if sign not in line:
        return line
    if divider == sign:  # only quoted fields may have it
        return re.sub(rf'"\s*({grouped.pattern})\s*"', lambda number: number[1].replace(sign, ""), line)
    fields = line.split(divider)
    return divider.join(
        field.replace(sign, "") if grouped.fullmatch(field.strip().strip('"')) else field for field in fields
    )
