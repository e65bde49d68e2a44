"""The measurements of a lot, as the diagnosis takes them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Flags
from inertial.state import State


@dataclass(frozen=True)
class Lot:
    """Measurements of a lot in g.

    state : the dwells of all units, (units, n)
    output : (units, n, 3), output over the nominal scale: g
    error : (units, n, 3), white standard error of each dwell mean, g; infinite where a dwell is missing
    response : (units, 3, 3), K over its diagonal: how a change of force shows on each axis
    radial : only the norm of the force is known; the state's force is then the corrected output's own direction
    recorded : the white errors are from the scatter and number of samples, not from the residuals
    scale : (units, 3), what the output of each axis was divided by; None where it is one for all
    loudness : (n,), standard deviation of the noise of each dwell over the lot's; None where it is the same in all
    """

    state: State
    output: Array
    error: Array
    response: Array
    radial: bool = False
    recorded: bool = False
    loudness: Array | None = None
    scale: Array | None = None

    @property
    def measured(self) -> Flags:
        """The dwells (n,) that any unit has on all axes."""
        return np.asarray(np.isfinite(self.error).all(axis=-1).any(axis=0))

    def units(self, index: Sequence[int]) -> "Lot":
        """The lot of some units only."""
        pick = np.asarray(index, dtype=np.intp)
        return replace(
            self,
            state=self.state.pick(pick),
            output=self.output[pick],
            error=self.error[pick],
            response=self.response[pick],
            scale=None if self.scale is None else self.scale[pick],
        )
