"""Arrow without numpy, for a short command that prints rows and computes nothing."""

from __future__ import annotations

import sys
from importlib import import_module

NOT_NEEDED = (
    "numpy",
    *(
        "pyarrow._azurefs",
        "pyarrow._gcsfs",
        "pyarrow._hdfs",
        "pyarrow._s3fs",
    ),  # the archive has opened its own store before
)
"""Modules that Arrow imports where they are there."""


def import_arrow_alone() -> None:
    """Import Arrow and its Parquet reader without numpy, which is two fifths of the time of both, and without remote stores.

    Arrow looks for numpy once, when it is imported; only its conversions to arrays and data frames need it. So this is for a
    process that ends with its answer, and does nothing where either library is there already, as with an archive in an object
    store.
    """
    if not {"numpy", "pyarrow"} & sys.modules.keys():
        for name in NOT_NEEDED:
            sys.modules[name] = None  # type: ignore[assignment] - how a process says that a library is not there
        try:
            import_module("pyarrow.parquet")
        finally:
            for name in NOT_NEEDED:
                del sys.modules[name]
