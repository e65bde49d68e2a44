"""Files of R, written here in R's own text format (R Internals, 1.8, "Serialization Formats"): the truth of the reader."""

import numpy as np
import pandas as pd
import pytest

from pipelines.importers.readers import rdata as reader
from schemas.errors import DataRejected

pytest.importorskip("rdata")

OBJECT, ATTRIBUTES, TAG = 0x100, 0x200, 0x400
SYMBOL, PAIRS, TEXT, LOGICAL, INTEGER, REAL, TEXTS, LIST, END, UTF8 = 1, 2, 9, 10, 13, 14, 16, 19, 254, 0x8000


def text(value: str | None) -> list[str]:
    """A string; NA where it is None."""
    if value is None:
        return [str(TEXT), "-1"]
    escaped = "".join(f"\\{byte:03o}" if byte > 126 or byte < 33 else chr(byte) for byte in value.encode())
    return [str(TEXT + UTF8), str(len(value.encode())), escaped]


def vector(kind: int, values: list, **attributes: list[str]) -> list[str]:
    """A vector with its attributes, by name; those with a class are objects."""
    flags = kind + (ATTRIBUTES if attributes else 0) + (OBJECT if "class" in attributes else 0)
    lines = [str(flags), str(len(values))]
    for value in values:
        lines += text(value) if kind == TEXTS else value if kind == LIST else ["NA" if value is None else str(value)]
    for name, value in attributes.items():
        lines += [str(PAIRS + TAG), str(SYMBOL), *text(name), *value]
    return [*lines, str(END)] if attributes else lines


def of_class(*names: str) -> dict[str, list[str]]:
    return {"class": vector(TEXTS, [*names])}


def frame() -> list[str]:
    """A data frame with a column of every kind that recordings have."""
    big = np.array([2**60 + 1, -3, np.iinfo(np.int64).min]).view(np.float64)
    columns = {
        "t": vector(REAL, [0.0, 0.1, 0.2]),
        "ax": vector(REAL, [1.25, None, -3.5]),
        "n": vector(INTEGER, [7, None, 9]),
        "count": vector(INTEGER, [1, 2, 3]),
        "still": vector(LOGICAL, [1, 0, None]),
        "unit": vector(TEXTS, ["A1", None, "µ"]),
        "pose": vector(INTEGER, [2, 1, None], levels=vector(TEXTS, ["up", "down"]), **of_class("factor")),
        "when": vector(REAL, [1767225600.25, None, 1767225602.0], **of_class("POSIXct", "POSIXt")),
        "ticks": vector(REAL, [repr(float(one)) for one in big], **of_class("integer64")),
    }
    rows = {"row.names": vector(INTEGER, [None, -3])}
    return vector(LIST, list(columns.values()), names=vector(TEXTS, list(columns)), **of_class("data.frame"), **rows)


def saved(content: list[str], *, name: str = "") -> bytes:
    """As ``saveRDS(…, ascii = TRUE)``, or, with a name, as ``save(…, ascii = TRUE)`` writes it."""
    body = [str(PAIRS + TAG), str(SYMBOL), *text(name), *content, str(END)] if name else content
    return "\n".join([*(["RDA2"] if name else []), "A", "2", "263168", "131840", *body, ""]).encode()


@pytest.mark.parametrize("name", ["", "imu"])
def test_every_kind_of_column_has_the_values_that_were_written(name: str) -> None:
    data = saved(frame(), name=name)
    assert reader.recognised(data)
    table = reader.read("a.rda", data, "").table
    assert list(table.columns) == ["t", "ax", "n", "count", "still", "unit", "pose", "when", "ticks"]
    np.testing.assert_array_equal(table["t"], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(table["ax"], [1.25, np.nan, -3.5])
    np.testing.assert_array_equal(table["n"], [7.0, np.nan, 9.0])
    assert table["count"].tolist() == [1, 2, 3]
    assert table["count"].dtype == np.int32
    np.testing.assert_array_equal(table["still"].to_numpy(dtype=float), [1.0, 0.0, np.nan])
    assert table["unit"].tolist()[::2] == ["A1", "µ"]
    assert table["pose"].tolist()[:2] == ["down", "up"]
    assert table[["unit", "pose"]].isna().sum().tolist() == [1, 1]
    assert table["when"].tolist()[0] == pd.Timestamp("2026-01-01 00:00:00.25")
    assert table["when"].isna().tolist() == [False, True, False]
    with pytest.raises(DataRejected, match="no data frame in this file of R, one is needed"):
        reader.read("a.rds", saved(vector(REAL, [1.0, 2.0])), "")
