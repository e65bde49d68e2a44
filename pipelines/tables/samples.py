"""Samples that come in tables: a record in one, a long one in several."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby

import pandas as pd

STATIC = "allan"
PROCEDURE = "procedure"


def by_record(samples: Iterable[pd.DataFrame]) -> Iterator[tuple[int, Iterator[pd.DataFrame]]]:
    """Number and tables of every record that has samples, each as long as it takes: not all of them lie in memory."""
    yield from groupby((table for table in samples if len(table)), key=lambda t: int(t["record"].iloc[0]))
