"""The measurements of a lot: the input of the diagnosis."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Flags
from inertial.state import State


@dataclass(frozen=True)
class Lot:
    """Measurements of a lot in g.

    state : the dwells of all units, (units, n)
    output : (units, n, 3), g, output divided by the nominal scale
    error : (units, n, 3), white standard error of each dwell mean, g; infinite where a dwell is missing
    response : (units, 3, 3), g/g, response matrix K over its diagonal: output of each axis per change of force
    radial : whether only the norm of the force is known; the state's force is then the direction of the corrected output
    recorded : whether the white errors come from the scatter and number of samples, not from the residuals
    scale : (units, 3), nominal scale by which the output of each axis was divided; None where it is 1
    loudness : (n,), standard deviation of the noise of each dwell over that of the lot; None where it is the same in all
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
        """Whether any unit has each dwell on all axes, (n,)."""
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
