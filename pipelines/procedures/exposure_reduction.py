"""Records of an exposure at one temperature, before beside after, and in the environment beside the room's air."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array, Flags
from inertial.dynamics.exposure import temperature_slope
from inertial.errors import NotIdentified
from pipelines.procedures.exposure_steps import AFTER, BEFORE, BETWEEN, DRY, FACES, SAME_K
from pipelines.procedures.recorded import numbers
from schemas.units import AXES


class Slope(NamedTuple):
    """Change with temperature (4,) per K at a temperature, and its standard error; zero where it is not known."""

    value: Array
    u: Array
    at_C: float

    def to_one(self, rows: pd.DataFrame, values: Array) -> Array:
        """Values (n,) of the records at the temperature of the slope."""
        columns = np.column_stack([np.ones(len(rows)), force_of(rows)])
        return values - columns @ self.value * (rows["temperature"].to_numpy(dtype=float) - self.at_C)


class Corrected(NamedTuple):
    """Records before and after of one axis, their values (n,) at one temperature, and the slope by which they are corrected.

    ``why`` they are not corrected; empty where they are.
    """

    still: pd.DataFrame
    output: Array
    slope: Slope
    why: str


def corrected(rows: pd.DataFrame, *, plain: bool) -> Corrected:
    """The change of bias and response with temperature taken out of one axis.

    It is that of the records in the room's air before the exposure and, where the exposure is one of temperature alone
    (``plain``), of those in it. The records after it are left out: a shift is no change with temperature.
    """
    still = rows[rows["series"].isin([BEFORE, AFTER])]
    known = rows[rows["series"].isin([BEFORE, DRY, *([BETWEEN] if plain else [])])]
    temperature, output = numbers(still, "temperature", "value")
    at, value = numbers(known, "temperature", "value")
    middle = float(temperature.mean()) if temperature.size else float("nan")
    try:
        found = temperature_slope(force_of(known), value, at, middle)
    except NotIdentified as problem:
        return Corrected(still, output, Slope(np.zeros(4), np.zeros(4), 0.0), str(problem))
    slope = Slope(found.value, found.u, middle)
    return Corrected(still, slope.to_one(still, output), slope, "")


def in_environment(rows: pd.DataFrame, slope: Slope) -> list[tuple[pd.DataFrame, Array, Flags]]:
    """For each soak of one axis in the environment its records beside those in the room's air at its temperature.

    Values (n,) are at the mean temperature of the soak; flags (n,) say which records are in the environment.
    """
    inside, dry = rows[rows["series"] == BETWEEN], rows[rows["series"].isin([BEFORE, DRY])]
    pairs: list[tuple[pd.DataFrame, Array, Flags]] = []
    for start in range(0, len(inside), len(FACES)):
        wet_rows = inside.iloc[start : start + len(FACES)]
        at = float(wet_rows["temperature"].mean())
        same = dry[np.abs(dry["temperature"] - at) < 2.0 * SAME_K]
        if same.empty:
            continue
        both = pd.concat([same, wet_rows])
        wet = (both["series"] == BETWEEN).to_numpy()
        pairs.append((both, slope._replace(at_C=at).to_one(both, numbers(both, "value")[0]), wet))
    return pairs


def force_of(rows: pd.DataFrame) -> Array:
    """The three forces (n, 3) of records, g."""
    return rows[[f"force_{axis}" for axis in AXES]].to_numpy(dtype=float)
