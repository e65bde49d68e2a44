"""Imports of much code without the garbage collector."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Generator


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
