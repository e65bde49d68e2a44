"""Imports of much code without the garbage collector."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def quick_imports() -> Generator[None]:
    """A block that imports much. What it makes stays, so it is not searched for garbage, neither in the block nor later.

    Prefect's server makes some hundred thousand objects while it is imported; searching them takes an eighth of that time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if enabled:
            gc.enable()
