"""From table and temperature to the noiseless output, with hidden physics in its place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from .device import Lot
from .physics import Physics, Table
from .scene import Scene
from .thermal import REFERENCE_C

Floats = NDArray[np.float64]
Active = Sequence[tuple[Physics, float]]


def specific_force(table: Table, units: int) -> Floats:
    """Specific force in each unit's seat, (U, n, 3), g: up seen through outer axis, skew, inner axis and slot."""
    count = len(table.outer)
    turn = Rotation.from_euler("XYZ", np.column_stack([table.outer, np.full(count, table.skew), table.inner]))
    force = turn.inv().apply(table.gravity * table.up / np.linalg.norm(table.up))
    if table.slot is None:
        return np.broadcast_to(force, (units, count, 3))
    return np.stack([Rotation.from_rotvec(slot).inv().apply(force) for slot in table.slot])


def nominal_force(scene: Scene) -> Floats:
    """Specific force that the read-back angles promise, (n, 3), g."""
    return specific_force(Table(scene.outer, scene.inner, np.array([0.0, 0.0, 1.0])), 1)[0]


def noiseless(lot: Lot, scene: Scene, active: Active) -> Floats:
    """Mean output of every unit in every dwell without noise, (U, n, 3), in g of nominal sensitivity."""
    table = Table(scene.outer, scene.inner, np.array([0.0, 0.0, 1.0]))
    for physics, amplitude in active:
        if physics.table is not None:
            physics.table(scene, table, amplitude)
    force = np.einsum("uij,unj->uni", lot.axes(), specific_force(table, scene.units))
    for physics, amplitude in active:
        if physics.stress is not None:
            force = physics.stress(scene, force, amplitude)
    warmth = (scene.temperature - REFERENCE_C)[..., None]
    # what temperature changes is the gain of an axis, not where the axis points
    output = (
        lot.bias[:, None]
        + lot.gain()[:, None] * (1.0 + warmth * lot.scale_tempco[:, None]) * force
        + warmth * lot.bias_tempco[:, None]
    )
    for physics, amplitude in active:
        if physics.signal is not None:
            output = output + amplitude * physics.signal(scene, force)
    for physics, amplitude in active:
        if physics.converter is not None:
            output = physics.converter(scene, output, amplitude)
    return output
