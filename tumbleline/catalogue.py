"""The physical effects that a model may have."""

from __future__ import annotations

import pandas as pd


def effects() -> pd.DataFrame:
    """One row per effect: id, symbol, equation, scope (sensor or station), and what to measure so that it shows."""
    from inertial.effects import catalogue

    columns = ("symbol", "equation", "scope", "breaker")
    rows = [{"id": name, **{column: getattr(one, column) for column in columns}} for name, one in catalogue().items()]
    return pd.DataFrame(rows)
