"""A sensor turned by hand, from physics: gravity, the rate of turning and the field of the Earth in its own axes."""

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

G = 9.80665
Rng = np.random.Generator
FIELD_UT = np.array([18.0, 2.0, -44.0])


class Hand:
    """A sensor turned by hand: time s, specific force g, rate rad/s and magnetic field µT, each (n, 3), without errors."""

    def __init__(
        self, rng: Rng, *, stops: int = 20, rate: float = 100.0, rest_s: float = 3.0, move_s: float = 1.0
    ) -> None:
        turns = Rotation.random(stops, random_state=rng)
        moved, at, times, poses = 0.0, [], [], []
        for k in range(stops):
            times += [moved, moved + rest_s]
            poses += [k, k]
            at.append((moved + 0.2 * rest_s, moved + 0.8 * rest_s))
            moved += rest_s + move_s * rng.uniform(0.7, 1.3)
        self.time = np.arange(0.0, times[-1], 1.0 / rate)
        path = Slerp(times, turns[poses])(self.time)
        self.force = path.inv().apply([0.0, 0.0, 1.0])
        self.field = path.inv().apply(FIELD_UT)
        step = (path[:-1].inv() * path[1:]).as_rotvec() * rate
        self.rate = np.vstack([step, step[-1:]])
        self.stops = np.stack([turns[k].inv().apply([0.0, 0.0, 1.0]) for k in range(stops)])
        self.n = len(self.time)


def sensed(rng: Rng, true: np.ndarray, scale: float, bias: tuple[float, ...], noise: float) -> np.ndarray:
    """The output of three axes with scale errors of a per cent, biases and white noise."""
    return scale * (true * (1.0 + 0.01 * rng.normal(size=3)) + np.array(bias)) + noise * rng.normal(size=true.shape)
