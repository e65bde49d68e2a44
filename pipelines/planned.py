"""What a recipe will make a lot go through, as a state of the science: for checks before any chamber time is spent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inertial.fits.linear import fit_lot
from inertial.frames import force_from_angles
from inertial.state import State
from pipelines.stages.reduce import STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from schemas.recipe import Recipe

NOMINAL_SUPPLY_V = 3.3
SUPPLY_WANDER_V = 1e-3
QUIET_G = 1e-3


def planned_state(recipe: Recipe) -> State:
    """The dwells of the fit in order of measurement: all poses at every temperature.

    Quantities that the plan does not set (supply, vibration) wander a little, as they do on a station, so that effects
    of theirs are not refused.
    """
    angles = np.radians([(pose.outer_deg, pose.inner_deg) for pose in recipe.poses])
    soaks, n = len(recipe.temperatures_C), len(recipe.poses)
    outer, inner = np.tile(angles[:, 0], soaks), np.tile(angles[:, 1], soaks)
    chamber = np.repeat(np.asarray(recipe.temperatures_C), n)
    step = recipe.settle_s + recipe.dwell_s
    time = np.arange(soaks * n) * step + np.repeat(np.arange(soaks) + 1, n) * recipe.soak_min_s
    wander = np.random.default_rng(0).normal(size=(2, time.size))
    gravity = recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
    return State(
        force=gravity * force_from_angles(outer, inner),
        time=time,
        temperature=chamber,
        chamber=chamber,
        since_power=time,
        since_move=np.full(time.size, recipe.settle_s) * (1.0 + 0.05 * wander[0]),
        supply=NOMINAL_SUPPLY_V + SUPPLY_WANDER_V * wander[1],
        vibration=QUIET_G * (1.0 + 0.1 * np.abs(wander[0])),
        outer=outer,
        inner=inner,
        slot=np.zeros(()),
    )


def refuse_unidentified(recipe: Recipe) -> None:
    """Refuse a model that the planned poses and temperatures cannot determine.

    Raises
    ------
    NotIdentified
        With the coefficients that cannot be told apart.
    """
    state = planned_state(recipe)
    fit_lot(recipe.effects, state, state.force.copy())
