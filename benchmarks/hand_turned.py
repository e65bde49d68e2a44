"""One unit turned by hand with a physical effect of ten times the noise: `python benchmarks/hand_turned.py --runs 8`.

39 dwells in directions that nobody knows, so that the magnitude of gravity is the only reference. The effects are made by
physics: two heated masses, a band-gap reference, an element behind its case, a die attach that sticks and slips, Preisach's
operator over the temperature, a transfer curve that saturates. Prints for each effect how often it is in a class, recommended
by dwells left out, and named beside another one.
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

Floats = NDArray[np.float64]
DWELLS, NOISE_UG, STEP_S = 39, 25.0, 0.5
Effect = Callable[["Hand"], Floats]


class Hand:
    """A person at a bench: when, in which direction and how warm.

    t : (m,), s, of a course every half second; middle : (39,), s, of the dwells; case : (m,), °C, recorded
    force : (39, 3), g; rng : of the unit
    """

    def __init__(self, seed: int, minutes: float, span: float, *, rests: bool = False) -> None:
        self.rng = np.random.default_rng([seed, 0x4A4D])
        share = self.rng.uniform(0.7, 1.3, DWELLS)
        each = 60.0 * minutes * share / share.sum()
        begin = np.concatenate([[0.0], np.cumsum(each)[:-1]])
        self.duration = 0.7 * each
        self.middle = begin + 0.5 * self.duration
        self.t = np.arange(-600.0, 60.0 * minutes + 30.0, STEP_S)
        faces = np.concatenate([np.eye(3), -np.eye(3)])
        about = np.concatenate([faces[self.rng.permutation(6)] for _ in range(DWELLS // 6 + 1)])[:DWELLS]
        tilt = np.where(self.rng.random(DWELLS) < 0.4, 0.2, 1.2)[:, None]
        self.force = Rotation.from_rotvec(tilt * self.rng.standard_normal((DWELLS, 3))).apply(about)
        self.case = 25.0 + self._course(60.0 * minutes, span, rests=rests)

    def _course(self, whole: float, span: float, *, rests: bool) -> Floats:
        """A hot-air gun and a freezer: up, down, up, as a person does it, who rests for half of the time or never."""
        if not span:
            return np.zeros(len(self.t))
        knots = np.array([-600.0, 0.0, 0.3, 0.65, 1.0]) * np.array([1.0, 1.0, whole, whole, whole])
        levels = span * np.array([0.0, 0.0, self.rng.uniform(0.8, 1.0), -self.rng.uniform(0.3, 0.6), 0.6])
        if rests:
            arrived = 0.5 * (knots[1:-1] + knots[2:])
            knots = np.concatenate([knots[:2], np.stack([arrived, knots[2:]], axis=1).ravel()])
            levels = np.concatenate([levels[:2], np.repeat(levels[2:], 2)])
        return lagged(np.interp(self.t, knots, levels), 40.0)

    def at(self, course: Floats) -> Floats:
        """Values (39, …) of a course at the dwells."""
        return course[np.searchsorted(self.t, self.middle)]

    def gains(self) -> Floats:
        """Factors (3,) of the axes."""
        return self.rng.choice([-1.0, 1.0], 3) * self.rng.uniform(0.5, 1.5, 3)


def lagged(course: Floats, tau: float) -> Floats:
    """A course through a first-order lag that begins at rest."""
    out = np.empty_like(course)
    out[0] = course[0]
    gain = 1.0 - np.exp(-STEP_S / tau)
    for k in range(1, len(course)):
        out[k] = out[k - 1] + gain * (course[k] - out[k - 1])
    return out


def warms_up(hand: Hand) -> Floats:
    """The electronics heat the element after switch-on, through a small mass and a large one."""
    on = (hand.t >= 0.0).astype(float)
    heat = lagged(lagged(on, hand.rng.uniform(5.0, 20.0)), hand.rng.uniform(140.0, 280.0))
    return hand.at(heat)[:, None] * hand.gains()


def curved_reference(hand: Hand) -> Floats:
    """A band-gap reference, bent over temperature, that shifts the zero."""
    kelvin = hand.case + 273.15
    return hand.at(kelvin / 300.0 * np.log(kelvin / 300.0) - (kelvin / 300.0 - 1.0))[:, None] * hand.gains()


def element_lags(hand: Hand) -> Floats:
    """The element follows the recorded case with a time constant of its own."""
    return hand.at(lagged(hand.case, hand.rng.uniform(60.0, 180.0)))[:, None] * hand.gains()


def sticks_and_slips(hand: Hand) -> Floats:
    """A die attach with dry friction: the shear force of the bond by Dahl's law over all temperatures since it was cured.

    dF/du = k·(1 − F/Fs·sgn du) with the mismatch u of die and case, which is proportional to the temperature: asperities bend
    before they slip, and there is no edge at which the bond begins to slip (P. R. Dahl, Solid friction damping of mechanical
    vibrations, AIAA Journal 14 (1976) 1675, with his exponent of 1). Random: the way Fs/k over which the force turns, 4 to
    14 K, which is 0.1 to 0.4 µm for 10 ppm/K at 3 mm from the middle of the die; the temperature of curing; one to four stays
    between −5 and 55 °C since then. While the temperature moves at one rate the force is that of a lag.
    """
    turns = hand.rng.uniform(4.0, 14.0)
    stays = hand.rng.uniform(-5.0, 55.0, hand.rng.integers(1, 5))
    course = np.concatenate([[hand.rng.uniform(120.0, 175.0), 25.0], stays, hand.case])
    force = np.zeros(len(course))  # free of stress while it cures; in units of Fs
    for k, change in enumerate(np.diff(course)):
        limit = np.sign(change)
        force[k + 1] = limit + (force[k] - limit) * np.exp(-abs(change) / turns)  # exact for a change in one direction
    return hand.at(force[-len(hand.t) :])[:, None] * hand.gains()


def switched_domains(hand: Hand) -> Floats:
    """Many small domains that switch at temperatures of their own, up and down: Preisach's operator."""
    up = hand.rng.normal(27.0, 18.0, 200)
    down = up - hand.rng.gamma(3.0, 5.0, 200)
    state = np.where(hand.case[0] > up, 1.0, np.where(hand.case[0] < down, -1.0, hand.rng.choice([-1.0, 1.0], 200)))
    path = np.empty(len(hand.t))
    for k, warm in enumerate(hand.case):
        state = np.where(warm > up, 1.0, np.where(warm < down, -1.0, state))
        path[k] = state.mean()
    return hand.at(path)[:, None] * hand.gains()


def saturates(hand: Hand) -> Floats:
    """A spring that stiffens: the output falls behind the force."""
    return -(np.sinh(0.5 * hand.force) / 0.5 - hand.force) * hand.gains()


def nothing(hand: Hand) -> Floats:
    """No effect at all."""
    return np.zeros((DWELLS, 3))


EFFECTS: dict[str, tuple[Effect, float, float, frozenset[str]]] = {
    "warm_up": (warms_up, 4.0, 0.0, frozenset({"warm_up"})),
    "temperature_curve": (
        curved_reference, 40.0, 22.0, frozenset({"bias_temperature_quadratic", "bias_temperature_cubic"}),
    ),
    "lag": (element_lags, 40.0, 22.0, frozenset({"thermal_lag", "thermal_rate"})),
    "friction": (sticks_and_slips, 40.0, 22.0, frozenset({"thermal_hysteresis"})),
    "hysteresis": (switched_domains, 40.0, 22.0, frozenset({"thermal_hysteresis"})),
    "cubic": (saturates, 6.0, 0.0, frozenset({"third_order"})),
    "nothing_4min": (nothing, 4.0, 0.0, frozenset()),
    "nothing_40min": (nothing, 40.0, 22.0, frozenset()),
}  # fmt: skip
"""Effect, minutes, span of the temperature, names in the catalogue that are right."""


def make(name: str, seed: int, size: float = 10.0, *, rests: bool = False) -> pd.DataFrame:
    """The dwells of a recording.

    size : RMS of the effect in the magnitude of the force, in multiples of a dwell's noise, after what bias, sensitivity and,
        where the temperature moves, their linear dependence on it take up
    rests : the temperature rests half of the time; else it moves all the time, at rates that hardly differ
    """
    effect, minutes, span, _ = EFFECTS[name]
    hand = Hand(seed, minutes, span, rests=rests)
    added = effect(hand)
    warm = hand.at(hand.case)
    theta = warm - 25.0
    linear = [np.ones(DWELLS), *hand.force.T]
    if span:
        linear += [theta, *(theta[:, None] * hand.force).T]
    basis = np.linalg.qr(np.stack(linear, axis=1))[0]
    # what shows in the magnitude alone: the component along the force after the base model of each axis
    left = added - basis @ (basis.T @ added)
    there = np.sqrt(np.mean(np.sum(left * hand.force, axis=1) ** 2)) if added.any() else 1.0
    added = added * size * NOISE_UG / there
    noise = NOISE_UG * hand.rng.standard_normal((DWELLS, 3))
    slow = np.cumsum(hand.rng.standard_normal((DWELLS, 3)) * np.sqrt(np.gradient(hand.middle))[:, None], axis=0)
    noise += 0.1 * slow
    matrix = np.eye(3) + 0.005 * hand.rng.standard_normal((3, 3))
    bias = 0.01 * hand.rng.standard_normal(3)
    out = hand.force @ matrix.T + bias + 1e-6 * (added + noise)
    if span:
        slope, gain = 1e-4 * hand.rng.standard_normal(3), 5e-5 * hand.rng.standard_normal(3)
        out += theta[:, None] * (slope + gain * hand.force)
    samples = np.round(100.0 * hand.duration)
    frame = pd.DataFrame({
        "unit": "HAND-1", "dwell": np.arange(DWELLS), "time_s": hand.middle, "duration_s": hand.duration, "n": samples,
    })  # fmt: skip
    for k, axis in enumerate("xyz"):
        frame[f"out_{axis}"], frame[f"sd_{axis}"] = out[:, k], 1e-6 * NOISE_UG * np.sqrt(samples)
    if span:
        frame["unit_C"] = warm + 0.02 * hand.rng.standard_normal(DWELLS)
    return frame.assign(out_unit="g")


def judged(name: str, frame: pd.DataFrame) -> dict[str, bool]:
    """What the diagnosis says of one recording."""
    from pipelines.diagnosis.diagnose import diagnose

    document = diagnose(frame)
    physics = [set(g["effects"]) for g in document["classes"] if g.get("scope") != "data"]
    right = EFFECTS[name][3]
    if not right:
        suspected = document["suspected"] is not None
        return {"named": bool(physics), "not adequate": document["adequate"] is False, "suspected": suspected}
    return {
        "in class": any(right & one for one in physics),
        "recommended": bool(right & set(document["recommended"])),
        "suspected": bool(document["suspected"] and right & set(document["suspected"]["effects"])),
        "another effect named": any(not right & one for one in physics),
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=8)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    parser.add_argument("--size", type=float, default=10.0, help="of the effect, in multiples of a dwell's noise")
    parser.add_argument("--rests", action="store_true", help="the temperature rests for half of the time")
    parser.add_argument("names", nargs="*", default=list(EFFECTS))
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in given.names:
        rows = [judged(name, make(name, given.first + k, given.size, rests=given.rests)) for k in range(given.runs)]
        said = ", ".join(f"{key} {sum(row[key] for row in rows)}" for key in rows[0])
        print(f"{name}: {len(rows)} recordings, {said}", flush=True)


if __name__ == "__main__":
    main()
