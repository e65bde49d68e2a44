"""LabVIEW measurement files (.lvm): text whose header blocks state divider, decimal sign, interval and units.

Source: National Instruments, "Specification for the LabVIEW Measurement File (.lvm)": a file header and a header per segment,
each ended by ``***End_of_Header***``, then a line of column names.
"""

import io

import numpy as np
import pandas as pd

from pipelines.importers import text_table
from pipelines.importers.content import Content, chosen
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown

NAME, TITLE, EXTRA, ORDER = "lvm", "LabVIEW measurement file", "", 100
MAGIC = b"LabVIEW Measurement"
END = "***End_of_Header***"
REMEDY = "export it again, or as CSV"
_DIVIDERS = {"tab": "\t", "comma": ",", "space": " "}


def recognised(data: bytes) -> bool:
    """Whether the first line is that of LabVIEW's measurement files."""
    return data.removeprefix(b"\xef\xbb\xbf").startswith(MAGIC)


def read(name: str, data: bytes, group: str) -> Content:
    """The channels of a segment beside `X_Value` in s; several segments are groups to choose from."""
    text, _ = text_table.decoded(data, name)
    parts = text.split(END)
    if len(parts) < 3:
        raise DataRejected(
            f"{name}: a LabVIEW file with {len(parts) - 1} ends of headers, two are needed at least; {REMEDY}"
        )
    about = _settings(parts[0], None)
    divider = _DIVIDERS.get(next(iter(about.get("Separator", ["tab"])), "tab").lower(), "\t")
    decimal = "," if next(iter(about.get("Decimal_Separator", ["."])), ".") == "," else "."
    # a header of a segment stands behind the rows of the segment before it, divided from them by an empty line
    heads = [parts[1], *(part.replace("\r", "").rpartition("\n\n")[2] for part in parts[2:-1])]
    bodies = [part.replace("\r", "").rpartition("\n\n")[0] or part for part in parts[2:-1]] + [parts[-1]]
    names = [(str(k + 1), body.count("\n")) for k, body in enumerate(bodies)]
    index = int(chosen(names, group, f"{name}: segments")) - 1
    return _segment(_settings(heads[index], divider), bodies[index], divider, decimal, name)


def _settings(text: str, divider: str | None) -> dict[str, list[str]]:
    """Key → words of the lines of a header."""
    settings: dict[str, list[str]] = {}
    for line in text.splitlines():
        parts = line.replace(",", "\t").split("\t") if divider is None else line.split(divider)
        key, *words = (part.strip() for part in parts)
        # "Decimal_Separator<TAB>," loses its comma to the guess of the divider
        comma = key == "Decimal_Separator" and divider is None and "," in line
        settings |= {key: [","] if comma else words} if key else {}
    return settings


def _segment(about: dict[str, list[str]], body: str, divider: str, decimal: str, name: str) -> Content:
    lines = [line for line in body.splitlines() if line.strip(" \t,;")]
    if len(lines) < 2:
        raise DataRejected(f"{name}: no rows of data were found, at least one is needed; check the file")
    labels = [word.strip() for word in lines[0].split(divider)]
    while labels and labels[-1] in {"", "Comment"}:
        labels.pop()
    if len(set(labels)) < len(labels) or not labels:
        raise DataRejected(f"{name}: columns {shown(', '.join(labels))}: names must differ; {REMEDY}")
    with foreign(f"{name}: rows that do not have the {len(labels)} columns of their header", "repair or remove them"):
        table = pd.read_csv(
            io.StringIO("\n".join(lines[1:])), sep=divider, decimal=decimal, header=None,
            names=[*labels, "\0comment"], index_col=False, low_memory=False,
        ).drop(columns="\0comment")  # fmt: skip
    with foreign(f"{name}: Delta_X that is no number", REMEDY):
        steps = {float(word.replace(",", ".")) for word in about.get("Delta_X", []) if word}
    interval = steps.pop() if len(steps) == 1 else None
    channels = [label for label in labels if label != "X_Value"]
    units = dict(zip(channels, about.get("Y_Unit_Label", []), strict=False))
    if "X_Value" in labels and table["X_Value"].isna().all():
        table = table.drop(columns="X_Value")
    if "X_Value" not in table and interval is not None and interval > 0.0:
        table.insert(0, "X_Value", interval * np.arange(len(table)))
    return Content(table, (), {"X_Value": "s", **{label: unit for label, unit in units.items() if unit}}, interval)
