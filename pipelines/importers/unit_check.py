"""Check of the numbers of a record against the given unit of its output."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.errors import DataRejected
from schemas.units import STANDARD_GRAVITY_M_S2

LIKELY = (0.5, 2.0)
"""Median norm over gravity of a record in the unit given: bias and shaking by hand stay well below."""
SURE = 0.05
GRAVITY = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2, "mg": 1e3}
"""Size of gravity in the units that need no sensitivity."""
VOLTS_PER_G = (1e-3, 20.0)
"""Sensitivities of analog accelerometers: shock sensors to seismic ones."""
_MOST = 200_000


def size_of(output: NDArray[np.float64]) -> float:
    """Size of gravity in a record (n, 3), as its median norm."""
    return float(np.median(np.linalg.norm(output[:_MOST], axis=1)))


def looks_like(size: float) -> str:
    """The unit without a sensitivity in which gravity has this size, within a factor of two; empty if there is none."""
    return next((unit for unit, one in GRAVITY.items() if LIKELY[0] < size / one < LIKELY[1]), "")


def refuse_other_unit(output: NDArray[np.float64], claimed: str, where: str) -> tuple[str, ...]:
    """Refuse a record whose norm contradicts the unit; remarks if it is only unusual.

    Parameters
    ----------
    output : (n, 3) in the file's own numbers.
    claimed : the given unit.
    """
    size = size_of(output)
    other = looks_like(size)
    if claimed in GRAVITY:
        if LIKELY[0] < size / GRAVITY[claimed] < LIKELY[1]:
            return ()
        advice = (
            f"the unit looks like {other}, give --units output={other}"
            if other
            else "numbers of a converter are LSB, of a voltmeter V or mV: --units output=LSB|V|mV"
        )
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g}, about {GRAVITY[claimed]:.5g} is needed if its unit is {claimed}; "
            f"{advice}"
        )
    close = next((unit for unit, one in GRAVITY.items() if abs(size / one - 1.0) < SURE), "")
    if claimed == "LSB":
        return _counts(output, size, close, where)
    volts = size * (1e-3 if claimed == "mV" else 1.0)
    if not VOLTS_PER_G[0] <= volts <= VOLTS_PER_G[1]:
        other = f"the unit looks like {other}" if other else "V and mV differ by a thousand"
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g} {claimed}, {VOLTS_PER_G[0]:g} to {VOLTS_PER_G[1]:g} V is what analog "
            f"accelerometers give at rest; {other}; correct --units output=…"
        )
    if close:
        return (f"CHECK THE UNIT: the norm of the output is {size:.5g}, as gravity in {close}; {claimed} was given",)
    return ()


def _counts(output: NDArray[np.float64], size: float, close: str, where: str) -> tuple[str, ...]:
    whole = bool(np.all(output[:1000] == np.rint(output[:1000])))
    if close and not whole:
        raise DataRejected(
            f"{where}: the norm of the output is {size:.5g} and its values are not whole numbers, counts are needed if its "
            f"unit is LSB; the unit looks like {close}, give --units output={close}"
        )
    if close:
        return (f"CHECK THE UNIT: the norm of the output is {size:.5g}, as gravity in {close}; LSB was given",)
    if not whole and np.ptp(output[:1000]) < 8.0:
        return (
            "CHECK THE UNIT: values within a few units of one another that are not whole numbers, but LSB was given",
        )
    return ()
