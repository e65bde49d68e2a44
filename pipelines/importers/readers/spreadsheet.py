"""Spreadsheets (.xlsx, .xls, .xlsb, .ods): the rows of one sheet, read as the text that it would be saved as."""

import csv
import datetime as dt
import io
import zipfile
from typing import Any

from pipelines.importers import text_table
from pipelines.importers.content import Content, chosen
from pipelines.importers.unpacking import refuse_larger
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "spreadsheet", "spreadsheet (.xlsx, .xls, .ods)", "excel", 25
PACKED, OLD = b"PK\x03\x04", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
PARTS = ("xl/workbook.xml", "xl/workbook.bin", "content.xml")
REMEDY = "save it again, or export the sheet as CSV"


def recognised(data: bytes) -> bool:
    """Whether it is a workbook: of an older Excel, or a zip archive with the parts of one."""
    return data.startswith(OLD) or (data.startswith(PACKED) and any(part.encode() in data for part in PARTS))


def read(name: str, data: bytes, group: str) -> Content:
    """The columns of a sheet; several sheets with rows are groups to choose from."""
    calamine = library("python_calamine", EXTRA, f"{name}: a spreadsheet")
    if data.startswith(PACKED):
        with foreign(f"{name}: a spreadsheet that does not unpack", REMEDY):
            size = sum(part.file_size for part in zipfile.ZipFile(io.BytesIO(data)).infolist())
        refuse_larger(size, len(data), name)
    with foreign(f"{name}: a spreadsheet that cannot be read", REMEDY):
        book = calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))
        sheets: dict[str, list[list[Any]]] = {
            title: book.get_sheet_by_name(title).to_python() for title in book.sheet_names
        }
    sheets = {title: rows for title, rows in sheets.items() if len(rows) > 1}
    counts = [(title, len(rows)) for title, rows in sheets.items()]
    title = chosen(counts, group, name, "no sheet with rows in this spreadsheet")
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([[_cell(value) for value in row] for row in sheets[title]])
    return text_table.content(text.getvalue(), name, "utf-8")


def _cell(value: object) -> str:
    """A cell as text: numbers with all their digits, times as ISO 8601, a duration in seconds."""
    if isinstance(value, float):
        return repr(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(value)
    if isinstance(value, dt.datetime | dt.date | dt.time):
        return value.isoformat()
    if isinstance(value, dt.timedelta):
        return repr(value.total_seconds())
    return str(value)
