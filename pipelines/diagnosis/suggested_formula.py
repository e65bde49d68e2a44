"""A formula for a model file, suggested if a driver explains the excess residual and no effect of the catalogue does."""

import numpy as np

from inertial.criticism.diagnosis import Unexplained
from inertial.expressions import NAMES, QUANTITIES
from inertial.quantities import formula_name
from inertial.state import State
from pipelines.diagnosis.documents import SuggestedFormula

_PARTS = {
    "bias": "the error",
    "scale": "the scale factor",
    "axes": "the directions of the axes",
    "transfer": "the transfer curve",
}


def what_follows(unexplained: Unexplained) -> str:
    """A text that names the property of the output and the driver that it depends on."""
    verb = "follow" if unexplained.part == "axes" else "follows"
    swing = "" if unexplained.period is None else f" with a period of {unexplained.period / 60.0:.3g} min"
    return f"{_PARTS[unexplained.part]} {verb} {unexplained.driver}{swing}"


def offer(unexplained: Unexplained, state: State) -> SuggestedFormula | None:
    """A formula of the driver: a line, an oscillation, or a cubic about mid-range; None if the driver is not a single quantity.

    For the scale factor and the axes it is multiplied by the forces along and across the axis; for the transfer curve the scaled
    driver is multiplied by the square and the cube of the force.

    Parameters
    ----------
    unexplained : the unexplained driver of a diagnosis
    state : its dwells
    """
    name = formula_name(unexplained.driver)
    values = _values(name, state)
    if values is None or not name.isidentifier():
        return None
    part = unexplained.part
    columns = [name] if unexplained.shape == "line" else _cubic(name, values)
    if unexplained.period is not None:
        columns = [
            f"{wave}({2.0 * np.pi / unexplained.period / QUANTITIES[name][1]:.6g} * {name})" for wave in ("sin", "cos")
        ]
    if part == "scale":
        columns = [f"f*{_factor(c)}" for c in columns]
    elif part == "axes":
        columns = [f"{across}*{_factor(c)}" for across in ("fj", "fk") for c in columns]
    elif part == "transfer":
        columns = [f"{_scaled(name, values)}*f**{power}" for power in (2, 3)]
    formula, why = f"{name.lower()}_{part}", f"{what_follows(unexplained)}; the cause is not known yet"
    listed = ", ".join(f'"{column}"' for column in columns)
    text = f'[[formula]]\nid = "{formula}"\ncolumns = [{listed}]\nwhy = "{why}"'
    return {"id": formula, "columns": columns, "why": why, "toml": text}


def _values(name: str, state: State) -> np.ndarray | None:
    if name in state.covariates:
        return state.covariates[name]
    if name not in NAMES or name not in QUANTITIES:
        return None
    attribute, factor, _ = QUANTITIES[name]
    values = getattr(state, attribute)
    return None if values is None else factor * values


def _cubic(name: str, values: np.ndarray) -> list[str]:
    """The quantity, and powers of it scaled to about −1 … 1, because unscaled powers would be nearly collinear."""
    scaled = _scaled(name, values)
    return [name, f"{scaled}**2", f"{scaled}**3"]


def _scaled(name: str, values: np.ndarray) -> str:
    low, high = float(np.min(values)), float(np.max(values))
    return f"(({name} - {0.5 * (low + high):.4g}) / {max(0.5 * (high - low), 1e-12):.3g})"


def _factor(column: str) -> str:
    return column if column.isidentifier() or column.startswith("(") else f"({column})"
