"""The layout of a text of numbers: divider, decimal sign, where the table begins, and which line names its columns.

Nothing is assumed about the beginning of a file, which often has settings of the device. The layout is read from the lines
further down, which are uniform, and the table begins with the first line of the same form.
"""

import contextlib
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

COMMENTS = ("#", "%")
BLANKS = r"\s+"
_OF_NUMBERS = frozenset("0123456789+-.")
"""First characters of a line that is plainly neither empty nor a comment."""
_SAMPLE = 300
_TAIL = 40
_RUN = 10
_LONGEST = 64
_POINT = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?(?:\d+,\d+|\d+|,\d+)(?:[eEdD][+-]?\d+)?")
_GAPS = frozenset({"", "nan", "-nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf", "infinity", "#n/a"})
_CANDIDATES = (
    *(("\t", "."), ("\t", ","), (";", "."), (";", ","), (",", "."), (",", ","), (BLANKS, "."), (BLANKS, ",")),
    *(("|", "."), ("|", ",")),
)
_ALIKE = 0.9
"""Share of sampled lines with the usual count of fields, needed for a divider."""


@dataclass(frozen=True)
class Layout:
    """Layout of a text.

    divider, decimal : a pattern for blanks; point or comma
    first : index of the first line of the table
    names : of the columns; empty if no line names them
    header : index of the line with the names; −1 if there is none, or if it is a comment
    integers : whether the names are only the numbers 0, 1, 2, …
    units : of the columns, from a separate line below the names; empty otherwise
    width : count of fields, a last empty one not counted
    trailing : whether every line ends with a divider
    """

    divider: str
    decimal: str
    first: int
    names: tuple[str, ...]
    header: int
    integers: bool
    units: tuple[str, ...]
    width: int
    trailing: bool


def is_comment(line: str) -> bool:
    """Whether a line is empty or a comment."""
    stripped = line.strip()
    return not stripped or stripped.startswith(COMMENTS)


def filled_lines(lines: Sequence[str]) -> list[int]:
    """Indices of the lines that are neither empty nor comments; without a call per line of numbers, for long records."""
    return [k for k, line in enumerate(lines) if line[:1] in _OF_NUMBERS or not is_comment(line)]


def fields_of(line: str, divider: str) -> list[str]:
    """The fields of a line, without the blanks about them and without quotes."""
    if divider == BLANKS:
        return [word.strip('"') for word in line.split()]
    if '"' in line and line.count('"') % 2 == 0 and len(line) < 100_000:
        with contextlib.suppress(csv.Error):  # a quote inside a field opens none, and a line break ends the field
            return [word.strip() for word in next(csv.reader([line], delimiter=divider, skipinitialspace=True))]
    return [word.strip().strip('"') for word in line.split(divider)]


def is_number(word: str, decimal: str = ".") -> bool:
    """Whether a word is a finite number, written with this decimal sign."""
    # a pattern takes time that grows with the square of a word's length, and no number has that length
    return len(word) <= _LONGEST and (_POINT if decimal == "." else _COMMA).fullmatch(word) is not None


def layout(lines: Sequence[str], filled: Sequence[int]) -> Layout | None:
    """The layout of a text's lines, those of ``filled_lines`` its rows; None if all lines are comments."""
    if not filled:
        return None
    sample = _sampled([lines[k] for k in filled])
    divider, decimal, width = _divided(sample)
    trailing = width > 1 and all(not f[-1] for f in (fields_of(s, divider) for s in sample) if len(f) == width)
    numeric = _numeric_columns(sample, divider, decimal, width)
    first = _first_row(lines, filled, divider, decimal, width, numeric)
    index = filled.index(first) if first < len(lines) else len(filled)
    header, names, units, integers = -1, (), (), False
    above = [fields_of(lines[k], divider) for k in filled[max(0, index - 2) : index]][::-1]
    if above and _is_header(above[0], width, decimal, trailing=trailing):
        header, names = filled[index - 1], tuple(above[0])
        named = [row for row in above[1:] if _is_header(row, width, decimal, trailing=trailing)]
        if named and _are_units(above[0], named[0]):
            header, names, units = filled[index - 2], tuple(above[1]), tuple(above[0])
    elif _only_numbered([fields_of(lines[k], divider) for k in filled[index : index + 2]]):
        header, names, integers = first, tuple(fields_of(lines[first], divider)), True
        first = filled[index + 1]
    elif not above or first > 0:
        names = _commented(lines, first, divider, width)
    count = width - 1 if trailing else width
    return Layout(divider, decimal, first, names[:count], header, integers, units[:count], count, trailing)


def _sampled(filled: list[str]) -> list[str]:
    """Lines of the later part of the text, where the table is."""
    if len(filled) <= _TAIL:
        return filled[len(filled) // 2 :]
    later = filled[len(filled) // 3 :]
    # runs of lines, not every so many: some loggers fill some columns in every fourth line only
    step = max(_RUN, len(later) * _RUN // _SAMPLE)
    return [line for k in range(0, len(later), step) for line in later[k : k + _RUN]]


def _divided(sample: Sequence[str]) -> tuple[str, str, int]:
    """Divider, decimal sign and count of fields that fit the sampled lines best."""
    best: tuple[float, ...] = ()
    chosen = (BLANKS, ".", 1)
    for order, (divider, decimal) in enumerate(_CANDIDATES):
        rows = [fields_of(line, divider) for line in sample]
        width, often = Counter(map(len, rows)).most_common(1)[0]
        words = [word for row in rows if len(row) == width for word in row if word]
        numbers = sum(is_number(word, decimal) for word in words) / max(1, len(words))
        alike = often / len(rows) >= _ALIKE
        # a divider that leaves nothing but numbers, then the more columns, then the usual order
        key = (float(alike and width > 1), round(numbers, 2), width, -order)
        if key > best:
            best, chosen = key, (divider, decimal, width)
    return chosen


def _numeric_columns(sample: Sequence[str], divider: str, decimal: str, width: int) -> list[bool]:
    rows = [row for row in (fields_of(line, divider) for line in sample) if len(row) == width]
    return [sum(is_number(row[k], decimal) for row in rows) > 0.5 * len(rows) for k in range(width)]


def _first_row(
    lines: Sequence[str], filled: Sequence[int], divider: str, decimal: str, width: int, numeric: list[bool]
) -> int:
    """The first line of the table: like the sampled rows, with the broken rows right above it, which are rows too."""
    if not any(numeric):
        return filled[1] if len(filled) > 1 else len(lines)  # names alone
    alike = (index for index, k in enumerate(filled) if _is_row(fields_of(lines[k], divider), decimal, numeric))
    index = next(alike, len(filled) - 1)
    last_number = max(k for k, here in enumerate(numeric) if here)
    while index > 0:
        row = fields_of(lines[filled[index - 1]], divider)
        short = last_number < len(row) < width  # without its last fields, which hold no numbers
        if not (len(row) == width or short) or not any(is_number(word, decimal) for word in row):
            break
        index -= 1
    return filled[index]


def _is_row(row: list[str], decimal: str, numeric: list[bool]) -> bool:
    """Whether a line is like the rows of the table: numbers, or gaps, where they have numbers, and one number at least."""
    if len(row) != len(numeric):
        return False
    words = [word for numeric_here, word in zip(numeric, row, strict=True) if numeric_here]
    numbers = [is_number(word, decimal) for word in words]
    return any(numbers) and all(known or word.lower() in _GAPS for known, word in zip(numbers, words, strict=True))


def _is_header(row: list[str], width: int, decimal: str, *, trailing: bool) -> bool:
    """Whether a line names columns: as many as the rows have fields, none a number, most of them there."""
    if len(row) != width and not (trailing and len(row) == width - 1):
        return False
    return not any(is_number(word, decimal) for word in row) and sum(map(bool, row)) >= 0.5 * width


def _are_units(row: list[str], above: list[str]) -> bool:
    """Whether a line below the names holds units: shorter words, often repeated, while the names are all different."""
    words = [word.strip("[]()") for word in row if word]
    return (
        len(set(above)) == len(above)
        and max(map(len, words), default=99) <= 8
        and (len(set(words)) < len(words) or all(word.startswith(("[", "(")) for word in row if word))
    )


def _only_numbered(rows: list[list[str]]) -> bool:
    """Whether the first of two lines numbers the columns and the second does not."""
    if len(rows) < 2 or not _counts(rows[0]):
        return False
    below = rows[1][-3:]
    return not all(word.isdigit() for word in below) or [int(b) - int(below[0]) for b in below] != [0, 1, 2]


def _counts(row: list[str]) -> bool:
    """Whether a line only numbers the columns: 0, 1, 2, … or 1, 2, 3, …, possibly after an empty field."""
    words = row[1:] if row and not row[0] else row
    if len(words) < 3 or not all(word.isdigit() and word.isascii() and len(word) < 6 for word in words):
        return False
    numbers = [int(word) for word in words]
    return numbers[0] in {0, 1} and all(b - a == 1 for a, b in pairwise(numbers))


def _commented(lines: Sequence[str], first: int, divider: str, width: int) -> tuple[str, ...]:
    """Names in the last comment above the table, if it has as many words as there are columns; else empty."""
    last = next((text for line in lines[:first][::-1] if (text := line.strip()).startswith(COMMENTS)), "")
    words = fields_of(last.lstrip("#% \t"), divider)
    return tuple(words) if last and len(words) == len(set(words)) == width and not any(map(is_number, words)) else ()
