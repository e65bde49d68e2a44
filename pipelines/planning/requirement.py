"""What a recipe is wanted to do, and what it may be made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from inertial import poses
from inertial.planning.pose_exchange import CRITERIA, ratios
from inertial.state import T_REFERENCE
from pipelines.planning.verification_poses import WHOLE_DEG

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from inertial.planning.discrimination import Discrimination
    from inertial.planning.pose_exchange import Criterion
    from schemas.station import StationConfig

    Array = NDArray[np.float64]

CANDIDATES = 26
QUARTERS = 4


@dataclass(frozen=True)
class Requirement:
    """What a recipe is wanted to do.

    wanted : (3, p), g per unit of the column, largest error of each coefficient of the model
    see : effects that must be seen beside the model
    levels : °C, temperatures that it must meet
    candidates : angles (c, 2) in degrees that its poses are chosen from
    legal : °C, temperatures that it may be measured at besides
    criterion : see :mod:`inertial.planning.pose_exchange`
    verification : how often each pose for verification is measured in the whole run, spread over the soaks
    effects : ids whose columns the ``wanted`` are for; the recipe's where empty
    parting : rivals that it must tell apart, in place of the errors wanted
    """

    wanted: Array
    see: tuple[str, ...]
    levels: tuple[float, ...]
    candidates: Array
    legal: tuple[float, ...] = ()
    criterion: Criterion = "worst"
    verification: int = 1
    effects: tuple[str, ...] = ()
    parting: Discrimination | None = None

    def shortfall(self, matrix: Array) -> Array:
        """What is above one where normal matrices (..., 3, p, p) do not fulfil the wish yet: errors over those wanted."""
        return ratios(matrix) if self.parting is None else self.parting.shortfall(matrix)

    @property
    def value(self) -> Callable[[Array], Array]:
        """What an exchange of poses makes small."""
        return CRITERIA[self.criterion] if self.parting is None else self.parting.value


def candidates(station: StationConfig, plan: str = "", count: int = CANDIDATES) -> Array:
    """Angles (c, 2) in degrees of poses to choose from: ``count`` directions over the sphere, both ways of turning there.

    A named plan takes their place where one is given. Faces alone would serve a straight line as well; directions between
    them show the rest of the physics for nothing.
    """
    angles = poses.plan(plan) if plan else WHOLE_DEG * np.round(poses.fibonacci(count) / WHOLE_DEG)
    other = np.stack([-angles[:, 0], np.where(angles[:, 1] > 0.0, angles[:, 1] - 180.0, angles[:, 1] + 180.0)], axis=1)
    both = np.unique(np.concatenate([angles, other]) + 0.0, axis=0)
    outer, inner = station.limits.outer_deg, station.limits.inner_deg
    legal = (both[:, 0] >= outer[0]) & (both[:, 0] <= outer[1]) & (both[:, 1] >= inner[0]) & (both[:, 1] <= inner[1])
    return both[legal]


def between(levels: Sequence[float]) -> tuple[float, ...]:
    """Temperatures in °C that a recipe may be measured at beside its own: quarters of the range, and the reference in it."""
    low, high = min(levels), max(levels)
    quarters = np.round(np.linspace(low, high, QUARTERS + 1), 1).tolist()
    return tuple(sorted({*levels, *quarters, *([T_REFERENCE] if low < T_REFERENCE < high else [])}))
