"""Arrow without numpy, for a short command that prints rows and computes nothing."""

from __future__ import annotations

import sys
from importlib import import_module


def import_arrow_alone() -> None:
    """Import Arrow and its Parquet reader without numpy, which is two fifths of the time of both.

    Arrow looks for numpy once, when it is imported; only its conversions to arrays and data frames need it. So this is for a
    process that ends with its answer, and does nothing where either library is there already.
    """
    if not {"numpy", "pyarrow"} & sys.modules.keys():
        sys.modules["numpy"] = None  # type: ignore[assignment] - how a process says that a library is not there
        try:
            import_module("pyarrow.parquet")
        finally:
            del sys.modules["numpy"]
