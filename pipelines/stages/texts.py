"""Texts that occur again and again in a column: each is turned into the column's kind of value once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from pandas.api.extensions import ExtensionArray


def picked(texts: Sequence[str], places: NDArray[np.intp]) -> ExtensionArray:
    """The texts at some places, (rows,), as a column."""
    return pd.array(np.asarray(texts, dtype=object), dtype="str").take(places)
