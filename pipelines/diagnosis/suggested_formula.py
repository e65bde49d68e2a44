"""The suggestion if a driver explains the excess and no effect of the catalogue does: a formula for a model file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.expressions import NAMES, QUANTITIES
from inertial.quantities import formula_name

if TYPE_CHECKING:
    from inertial.criticism.diagnosis import Unexplained
    from inertial.state import State


def offer(unexplained: Unexplained, state: State) -> dict[str, Any] | None:
    """A formula that follows the driver: a line, or a cubic about the middle of its range; None if the driver is no single one.

    Parameters
    ----------
    unexplained : of a diagnosis
    state : its dwells
    """
    name = formula_name(unexplained.driver)
    values = _values(name, state)
    if values is None or not name.isidentifier():
        return None
    return {
        "id": f"{name.lower()}_bias",
        "columns": [name] if unexplained.shape == "line" else _cubic(name, values),
        "why": f"the residuals follow {unexplained.driver}; the cause is not known yet",
    }


def as_toml(formula: dict[str, Any]) -> str:
    """The formula as text of a model file."""
    columns = ", ".join(f'"{c}"' for c in formula["columns"])
    return f'[[formula]]\nid = "{formula["id"]}"\ncolumns = [{columns}]\nwhy = "{formula["why"]}"'


def _values(name: str, state: State) -> np.ndarray | None:
    if name in state.covariates:
        return state.covariates[name]
    if name not in NAMES or name not in QUANTITIES:
        return None
    attribute, factor, _ = QUANTITIES[name]
    values = getattr(state, attribute)
    return None if values is None else factor * values


def _cubic(name: str, values: np.ndarray) -> list[str]:
    """Powers of the quantity scaled to about −1 … 1: unscaled powers would be nearly collinear."""
    low, high = float(np.min(values)), float(np.max(values))
    scaled = f"(({name} - {0.5 * (low + high):.4g}) / {max(0.5 * (high - low), 1e-12):.3g})"
    return [name, f"{scaled}**2", f"{scaled}**3"]
