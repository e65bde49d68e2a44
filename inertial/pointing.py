"""Whether a table stood where its encoders said, judged from the outputs of a whole lot: every unit is an inclinometer."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from inertial.arrays import Array
from inertial.frames import force_from_angles

SPARE = 2  # degrees of freedom per axis before anything is said


POINTING_DEG = 0.1  # 1.7 mg; what a model of the table's imperfections is for is far smaller


TURNED_AWAY = "the outputs of all units turn"


def pointing_error(force: Array, output: Array) -> float:
    """By how many degrees (rms) the true force turned away from the believed one, as all units say; 0 where too few dwells tell.

    Residuals of a linear model per unit, in g; their median over the units is the table's part, and of that what is square to the
    force, since an angle cannot change its size. What the model has absorbed is put back by its degrees of freedom.

    Parameters
    ----------
    force : (n, 3), g, from the encoders, at one temperature
    output : (n, units, 3), unit of the output
    """
    spare = len(force) - 4
    if spare < SPARE:
        return 0.0
    design = np.column_stack([force, np.ones(len(force))])
    flat = output.reshape(len(output), -1)
    coefficients, _, rank, _ = np.linalg.lstsq(design, flat, rcond=1e-6)
    gain = np.linalg.norm(coefficients[:3], axis=0)
    if rank < design.shape[1] or not np.all(gain > 0.0):
        return 0.0
    common = np.median(((flat - design @ coefficients) / gain).reshape(output.shape), axis=1)
    size = np.sum(force**2, axis=1, keepdims=True)
    square = common - force * np.sum(common * force, axis=1, keepdims=True) / size
    turned = np.sqrt(np.sum(square**2) / spare / 2.0 / np.mean(size))
    return float(np.degrees(turned))


def contradicts(turned: float) -> str:
    """What is said of a table that does not stand where its encoders say; nothing where it does."""
    if turned <= POINTING_DEG:
        return ""
    return (
        f"{TURNED_AWAY} {turned:.2f}° rms away from the encoders' angles, {POINTING_DEG:g}° is allowed; check zero and gears of "
        "the table's axes, and measure the lot anew (run with --repeat)"
    )


def _force(angles: Array) -> Array:
    turned = np.radians(angles)
    return force_from_angles(turned[:, 0], turned[:, 1])


@dataclass
class Pointing:
    """The dwells of the soak that is under way, as far as this process has taken them."""

    soak: int = -1
    angles: list[tuple[float, float]] = field(default_factory=list)
    means: list[Mapping[str, Array]] = field(default_factory=list)

    def add(self, soak: int, angles: tuple[float, float], means: Mapping[str, Array]) -> float:
        """The pointing error in degrees with one more dwell; ``means`` are the units' mean outputs (3,)."""
        if soak != self.soak:
            self.soak, self.angles, self.means = soak, [], []
        self.angles.append(angles)
        self.means.append(means)
        units = [unit for unit in self.means[0] if all(unit in dwell for dwell in self.means)]
        if not units:
            return 0.0
        output = np.array([[dwell[unit] for unit in units] for dwell in self.means])
        return pointing_error(_force(np.array(self.angles)), output)
