"""Delimited text: one row per line, divided by tabs, commas, semicolons, bars or blanks."""

from pipelines.importers import text_table
from pipelines.importers.content import Content

NAME, TITLE, EXTRA, ORDER = "text", "CSV, TSV or other delimited text", "", 1000


def recognised(data: bytes) -> bool:
    """Always: what no other reader recognises must be text."""
    return True


def read(name: str, data: bytes, group: str) -> Content:
    """The columns of a text, named as there."""
    text, encoding = text_table.decoded(data, name)
    return text_table.content(text, name, encoding)
