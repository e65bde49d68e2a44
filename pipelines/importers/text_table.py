"""Text of numbers as columns: decoded, with its layout detected and stated; damaged rows are refused."""

import io
import re
import warnings
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, unit_in
from pipelines.importers.named_columns import is_of_serials
from pipelines.importers.text_layout import Layout, fields_of, filled_lines, is_comment, is_number, layout
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown

_MORE = "\0more"
MOST_COLUMNS = 10_000
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f-\x9f]")
_OPEN = re.compile(r'(?:^|[,;\t|]) *"[^"]*$')
_BLOCK = 100_000
_FEW_BYTES, _MOSTLY = 16, 0.9
_MOST_LINES = 10
"""Line breaks of a quoted field, at most: beyond them the quote is a sign such as that of inches."""
_PLAIN = re.compile(r"-?(?:0|[1-9]\d{0,14})(?:\.0*)?")
"""A whole number that reads back as it was written."""
_FORTRAN = re.compile(r"^\s*[+-]?\d*\.?\d+[dD][+-]?\d+\s*$")

_SURE = ("'", "\N{RIGHT SINGLE QUOTATION MARK}", "\N{NO-BREAK SPACE}", "\N{NARROW NO-BREAK SPACE}", "\N{THIN SPACE}")
"""Signs that stand in no number for anything else."""
_RATE = re.compile(
    r"(?:\b(?:sampl(?:e|es|ed|ing)|data)[ _-]?(?:rate|frequency)|\bsampl(?:ed|ing|es) at|\bdata file created by\b.* at)"
    r"[^\w\n]{0,4}(?:(\d+(?:\.\d+)?) ?Hz\b|Hz\b\W{1,4}(\d+(?:\.\d+)?)\s*$)",
    re.IGNORECASE,
)
"""A rate of samples in a line before the table: 'Sample rate: 100 Hz', 'Sampling frequency [Hz]; 200', 'sampled at 30 Hz', or the
line by which a logger says how its file was made; that of a shaker or a filter is none."""
_NAMES = {",": "a comma", ".": "a point", "'": "an apostrophe", _SURE[1]: "an apostrophe"}
_DIVIDERS = (";", "\t", "|", ",")
_SAMPLED_LINES = 400
_ALIKE = 0.9
_MANY = 20
"""Numbers with a sign from which on their form shows that it groups digits: three behind each sign, never a leading zero, and in
the same column whole numbers without it, all below a thousand."""


def decoded(data: bytes, where: str) -> tuple[str, str]:
    """The text of a file and its encoding: UTF-8, UTF-16 with or without a byte-order mark, or Windows-1252.

    Raises
    ------
    DataRejected
        It has none of these encodings.
    """
    marked = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    for encoding in ("utf-16",) if marked else _wide(data) or ("utf-8-sig", "cp1252"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if encoding == "utf-8-sig" or not _CONTROL.search(text[:100_000]):
            return text, "UTF-8" if encoding == "utf-8-sig" else encoding.upper().replace("CP1252", "Windows-1252")
    raise DataRejected(f"{where}: neither text (UTF-8) nor a known format of recordings; export it as CSV")


def _wide(data: bytes) -> tuple[str, ...]:
    """UTF-16 without a byte-order mark, as some programs save it: numbers have a zero in every other byte."""
    head = data[:4000]
    if len(head) < _FEW_BYTES or len(data) % 2:
        return ()
    zeros = [head[start::2].count(0) / len(head[start::2]) for start in (0, 1)]
    if min(zeros) > 0.0 or max(zeros) < _MOSTLY:
        return ()
    return ("utf-16-le",) if zeros[1] > zeros[0] else ("utf-16-be",)


def content(text: str, where: str, encoding: str = "UTF-8") -> Content:
    """The columns of a text, named as there ("1", "2", … without a header), and its detected layout."""
    lines, grouped = without_thousands(logical_lines(text))
    filled: Sequence[int] = filled_lines(lines)
    if len(filled) == len(lines):
        filled = range(len(lines))  # of a million rows 8 MB, and as much again on the way between processes
    detected = layout(lines, filled)
    if detected is None:
        raise DataRejected(f"{where}: no rows of data were found, at least one is needed; check the file")
    labels = _labels(detected, where)
    rows = filled[bisect_left(filled, detected.first) :]
    body = [lines[k] for k in rows]
    table = _parsed(body, detected, labels, where)
    stated = detected.units if any(detected.units) else map(unit_in, labels)
    units = {label: unit.strip("[]() ") for label, unit in zip(labels, stated, strict=False) if unit}
    remarks = (*_remarks(detected, lines, encoding), *([grouped] if grouped else []))
    # a line break inside a quoted field, or lines that the parser joins, moves all rows behind it
    line_by_line = len(lines) == len(text.splitlines()) and len(rows) == len(table)
    interval, stated_by = _stated_interval(lines[: detected.first])
    words = _words(body, detected, table, where)
    for name in filter(is_of_serials, words):
        table[name] = words[name]
    return Content(table, (*remarks, *stated_by), units, interval, ((where, rows),) if line_by_line else (), words)


def _stated_interval(lines: Sequence[str]) -> tuple[float | None, tuple[str, ...]]:
    """The interval of samples by the rate, Hz, that lines before the table state, and a remark; None if two differ."""
    found = [(match, line) for line in lines[:_SAMPLED_LINES] if (match := _RATE.search(line))]
    rates = {float(match[1] or match[2]) for match, _ in found}
    if len(rates) != 1 or not min(rates) > 0.0:
        return None, ()
    line = shown(found[0][1].strip(), 150)
    return 1.0 / min(rates), (
        f"{min(rates):g} samples in a second, where no column of time tells it, by the line '{line}'",
    )


def logical_lines(text: str) -> list[str]:
    """The rows of a text: a line break inside a quoted field is a part of the field, as in RFC 4180."""
    if '"' not in text:
        return text.splitlines()
    rows: list[str] = []
    waiting: list[str] = []  # lines of a field whose opening quote is not closed yet
    for line in text.splitlines():
        if not waiting and '"' not in line:
            rows.append(line)
            continue
        waiting.append(line)
        together = "\n".join(waiting)
        if together.count('"') % 2 == 0 or not _OPEN.search(together):
            rows.append(together)
            waiting = []
        elif len(waiting) > _MOST_LINES:  # a quote that does not begin a quotation
            rows += waiting
            waiting = []
    return rows + waiting


def _labels(detected: Layout, where: str) -> list[str]:
    if detected.width > MOST_COLUMNS:
        line = f"{detected.width} columns in line {max(detected.header, 0) + 1}"
        raise DataRejected(f"{where}: {line}, at most {MOST_COLUMNS} are read; one row per sample is needed")
    if not detected.names:
        return [str(k + 1) for k in range(detected.width)]
    labels = [name or f"column {k + 1}" for k, name in enumerate(detected.names)]
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise DataRejected(f"{where}: column '{shown(twice)}' is there twice, names must differ; rename one")
    return labels


def _parsed(body: Sequence[str], detected: Layout, labels: list[str], where: str) -> pd.DataFrame:
    if not body:
        return pd.DataFrame(columns=labels)
    wrong = f"{where}: rows from line {detected.first + 1} on do not have the {len(labels)} columns of the first"
    extra = [*labels, *(["\0last"] if detected.trailing else []), _MORE]
    with foreign(wrong, "repair or remove the broken rows"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        table = _read(body, detected, extra)
    more = table.pop(_MORE).notna().to_numpy()
    if detected.trailing:
        more = more | table.pop("\0last").notna().to_numpy()
    if more.any():
        row = int(np.flatnonzero(more)[0])
        raise DataRejected(f"{wrong} (row {row} has more); repair or remove the broken rows")
    return _fortran(table)


def _read(body: Sequence[str], detected: Layout, names: list[str]) -> pd.DataFrame:
    """The rows by the parser: in blocks, as it takes ten times their size, unless a column is text in some blocks only."""

    def parsed(rows: Sequence[str]) -> pd.DataFrame:
        return pd.read_csv(
            io.StringIO("\n".join(rows)), sep=detected.divider, decimal=detected.decimal, header=None, names=names,
            index_col=False, skipinitialspace=True, low_memory=False,
        )  # fmt: skip

    if len(body) > 2 * _BLOCK:
        with suppress(ValueError):  # a broken row: the parser of the whole names it
            parts = [parsed(body[k : k + _BLOCK]) for k in range(0, len(body), _BLOCK)]
            kinds_of_columns = [{part.dtypes.iloc[k].kind for part in parts} for k in range(len(names))]
            if all(len(kinds) == 1 or kinds <= {"i", "u", "f"} for kinds in kinds_of_columns):
                return pd.concat(parts, ignore_index=True)
    return parsed(body)


def _words(body: Sequence[str], detected: Layout, table: pd.DataFrame, where: str) -> dict[str, list[str]]:
    """Columns that may hold names, as they were written, where the parser took names for numbers, flags or gaps: 007, 1e5, NA."""
    may = [k for k in range(len(table.columns)) if _may_name(table.iloc[:, k])]
    if not may:
        return {}
    with foreign(
        f"{where}: rows that do not divide into the columns", "check the quotes and the dividers of its fields"
    ):
        written = pd.read_csv(
            io.StringIO("\n".join(body)), sep=detected.divider, header=None, usecols=may, dtype=str, keep_default_na=False,
            skipinitialspace=True, names=[*table.columns, *(["\0last"] if detected.trailing else [])], index_col=False,
        )  # fmt: skip
    columns = {str(table.columns[k]): written.iloc[:, index].str.strip() for index, k in enumerate(may)}
    return {
        name: column.tolist()
        for name, column in columns.items()
        if not all(_PLAIN.fullmatch(word) for word in column.unique().tolist())
    }


def _may_name(column: pd.Series) -> bool:
    """Whether the values of a column repeat as serial numbers do, and are whole numbers, flags, or partly gaps."""
    distinct = column.unique()
    if len(distinct) > 1 and 2 * len(distinct) > len(column):
        return False
    if column.dtype.kind == "f":
        return bool(np.all(~np.isfinite(distinct) | (distinct == np.rint(distinct))))
    return column.dtype.kind in "iub" or bool(column.isna().any())


def _fortran(table: pd.DataFrame) -> pd.DataFrame:
    """Numbers with the exponent D of Fortran as numbers."""
    for name in table.columns:
        column = table[name]
        if column.dtype.kind in "fiub" or not len(column) or not _FORTRAN.match(str(column.iloc[0])):
            continue
        table[name] = pd.to_numeric(column.astype(str).str.replace("D", "e", case=False), errors="coerce")
    return table


def _remarks(detected: Layout, lines: Sequence[str], encoding: str) -> tuple[str, ...]:
    remarks: list[str] = []
    begin = detected.first if detected.header < 0 else detected.header
    passed = [line for line in lines[:begin] if not is_comment(line)]
    if passed:
        where = f"the {'header' if detected.header >= 0 else 'first row'} in line {begin + 1}"
        start = shown(passed[0].strip(), 60)
        remarks.append(f"{len(passed)} lines before {where} were not read, beginning with '{start}'")
    if detected.integers:
        numbers = ", ".join(filter(None, detected.names[:6]))
        remarks.append(f"line {detected.header + 1} only numbers the columns: {numbers}, …")
    elif detected.names and detected.header < 0:
        remarks.append(f"columns named by a comment: {shown(', '.join(detected.names))}")
    if detected.decimal == ",":
        remarks.append("numbers with a decimal comma")
    if encoding != "UTF-8":
        remarks.append(f"text in {encoding}")
    return tuple(remarks)


def without_thousands(lines: Sequence[str]) -> tuple[Sequence[str], str]:
    """Lines with their numbers without separators of thousands, and a remark; the lines as they are where there are none.

    16,384 · 16.384,5 · 16'384 · 16 384. A comma or a point may also be the decimal sign, and 16,384 read as 16.384 gives a record
    that looks sound: a sign counts as a separator only where the text shows it; elsewhere it stays the decimal sign.
    """
    later = lines[len(lines) // 3 :]
    sample = [line for line in later[:: max(1, len(later) // _SAMPLED_LINES)] if not is_comment(line)]
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
    signed = [word for word in words if re.search(rf"\d{re.escape(sign)}\d", word)]
    grouped = _grouped(sign)
    if not signed or not all(grouped.fullmatch(word) for word in signed):
        return False
    if sign not in {",", "."}:
        return True
    other = "." if sign == "," else ","
    if any(other in word or word.count(sign) > 1 for word in signed):
        return True
    if any(other in word and is_number(word, other) for word in words):
        return True  # the decimal sign of this text is the other sign
    return len(signed) >= _MANY and any(
        _mixed([row[k] for row in rows if k < len(row)], grouped) for k in range(max(map(len, rows)))
    )


def _mixed(column: Sequence[str], grouped: re.Pattern[str]) -> bool:
    """Whether a column has grouped numbers, and whole numbers, which are all below a thousand."""
    ungrouped = [abs(int(word)) for word in column if re.fullmatch(r"[+-]?\d{1,12}", word)]
    return any(ungrouped) and max(ungrouped) < 1000 and any(grouped.fullmatch(word) for word in column)


def _cleaned(line: str, divider: str, sign: str, grouped: re.Pattern[str]) -> str:
    if sign not in line:
        return line
    if divider == sign:  # only quoted fields may have it
        return re.sub(rf'"\s*({grouped.pattern})\s*"', lambda number: number[1].replace(sign, ""), line)
    fields = line.split(divider)
    return divider.join(
        field.replace(sign, "") if grouped.fullmatch(field.strip().strip('"')) else field for field in fields
    )
