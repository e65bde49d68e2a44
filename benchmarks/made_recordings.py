"""Recordings of one sensor turned by hand, with the truth behind them; nothing is shared with the estimator."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.worlds.noise import Noise, dwell_noise

Floats = NDArray[np.float64]
RATE_HZ = 100.0
GRAVITY = 9.80665
FIRST_REST_S = 50.0
_DRAWN = 400  # records for the covariance of a noise
NOISES = {
    "white 280": Noise(white=280.0, flicker=0.0),
    "white 280, B 30": Noise(white=280.0, flicker=30.0),
    "white 25, B 30": Noise(white=25.0, flicker=30.0),
    "white 25, B 30, K 4": Noise(white=25.0, flicker=30.0, walk=4.0),
    "white 100, axes 1:2:3": Noise(white=100.0, flicker=10.0, axis_factors=(1.0, 2.0, 3.0)),
}


@dataclass(frozen=True)
class Recording:
    """One recording to be made.

    positions : dwells; noise : name in NOISES; long_first : whether a long rest begins it; cubic, warm_up : sizes of a hidden
    cubic term (µg/g³ on z) and of a drift after switching on (µg, x); bad : how many dwells are off by bad_ug, or where bad_sigma
    is given by so many standard deviations of the norm about its prediction by the other dwells, the noise known
    sensor : seed of the sensor itself, so that another seed is another recording of it; its own for every recording where None
    """

    positions: int = 40
    noise: str = "white 280"
    long_first: bool = True
    cubic: float = 0.0
    warm_up: float = 0.0
    warm_up_s: float = 250.0
    bad: int = 0
    bad_ug: float = 0.0
    bad_sigma: float = 0.0
    unit: str = "HAND-1"
    sensor: int | None = None


@dataclass(frozen=True)
class Made:
    """The dwells in the exchange format, and the truth behind them.

    wander : (3,), mean of the slow noise over the dwells, each by its length, g
    known : (n,), deviation of each norm from its prediction by the others with the true noise, standard deviations
    """

    dwells: pd.DataFrame
    spoilt: tuple[int, ...]
    bias: Floats
    response: Floats
    wander: Floats
    known: Floats | None = None


def make(what: Recording, seed: int) -> Made:
    """One recording: turned by hand, in raw counts, 100 Hz."""
    rng = np.random.default_rng(seed)
    n = what.positions
    length = np.round(np.exp(rng.uniform(np.log(2.0), np.log(60.0), n)), 1)
    if what.long_first:
        length[0] = FIRST_REST_S
    start = np.concatenate([[0.0], np.cumsum(length + rng.uniform(1.0, 5.0, n))[:-1]])
    force = _placed(n, rng)
    own = rng if what.sensor is None else np.random.default_rng(what.sensor)
    bias = 32768.0 + own.uniform(-300.0, 300.0, 3)
    response = 4080.0 * (np.diag(1.0 + own.uniform(-0.01, 0.01, 3)) + 0.004 * own.standard_normal((3, 3)))
    again = copy.deepcopy(rng)
    error = dwell_noise(NOISES[what.noise], start, length, 1, rng)[0]
    slow = dwell_noise(replace(NOISES[what.noise], white=0.0), start, length, 1, again)[0]
    middle = start + 0.5 * length
    error[:, 2] += what.cubic * force[:, 2] ** 3
    error[:, 0] += what.warm_up * np.exp(-middle / what.warm_up_s)
    spoilt = tuple(sorted(rng.choice(np.arange(1, n), what.bad, replace=False).tolist())) if what.bad else ()
    size = np.full(n, what.bad_ug)
    if what.bad_sigma:
        predicted = projector(what.noise, start, length, force)
        size = what.bad_sigma / np.sqrt(np.diagonal(predicted))
    for dwell in spoilt:
        way = _direction(force[dwell], rng)
        along = abs(float(way @ force[dwell])) if what.bad_sigma else 1.0
        error[dwell] += size[dwell] / along * way
    known = None
    if what.bad_sigma:
        known = predicted @ np.sum(error * force, axis=1) / np.sqrt(np.diagonal(predicted))
    output = bias + (force + 1e-6 * error) @ response.T
    samples = np.round(RATE_HZ * length)
    white = NOISES[what.noise].white * np.array(NOISES[what.noise].axis_factors)
    sd = 4080.0 * 1e-6 * white * np.sqrt(RATE_HZ / 2.0)
    sd = sd * np.sqrt(rng.chisquare(samples - 1.0, (3, n)).T / (samples - 1.0)[:, None])
    frame = pd.DataFrame(
        {"unit": what.unit, "dwell": np.arange(n), "time_s": middle, "duration_s": length, "n": samples}
    )
    for k, axis in enumerate("xyz"):
        frame[f"out_{axis}"], frame[f"sd_{axis}"] = output[:, k], sd[:, k]
    wander = 1e-6 * np.average(slow, axis=0, weights=length)
    return Made(frame.assign(out_unit="LSB"), spoilt, bias, response, wander, known)


def projector(noise: str, start: Floats, length: Floats, force: Floats) -> Floats:
    """P (n, n) = V⁻¹ − V⁻¹H(HᵀV⁻¹H)⁻¹HᵀV⁻¹ of the norms, µg⁻², with the nine columns H that show and the true noise V.

    V is the covariance of 400 records of this noise in these dwells. With the noise known, (Py)/√diag(P) of the norms y are the
    deviations of the dwells from their prediction by the others, in standard deviations.
    """
    drawn = dwell_noise(NOISES[noise], start, length, _DRAWN, np.random.default_rng(1))
    inverse = np.linalg.inv(np.cov(np.sum(drawn * force, axis=2).T)) * (_DRAWN - len(start) - 2) / (_DRAWN - 1)
    i, j = np.triu_indices(3)
    columns = np.concatenate([force, force[:, i] * force[:, j]], axis=1)
    weighted = inverse @ columns
    return inverse - weighted @ np.linalg.solve(columns.T @ weighted, weighted.T)


def _placed(n: int, rng: np.random.Generator) -> Floats:
    """Directions of the force, (n, 3): faces put down by hand, and anything in between."""
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    about = np.concatenate([faces[rng.permutation(6)] for _ in range(n // 6 + 1)])[:n]
    tilt = np.where(rng.random(n) < 0.5, 0.15, 1.2)
    return Rotation.from_rotvec(tilt[:, None] * rng.standard_normal((n, 3))).apply(about)


def _direction(force: Floats, rng: np.random.Generator) -> Floats:
    """Where a spoilt dwell is off: mostly along the force, as only that shows in the norm."""
    way = force * rng.choice([-1.0, 1.0]) + 0.5 * rng.standard_normal(3)
    return way / np.linalg.norm(way)


def samples_of(what: Recording, seed: int) -> pd.DataFrame:
    """The same as a record of samples at 100 Hz, moved by hand between the rests: time_s, x, y, z."""
    made = make(what, seed)
    rng = np.random.default_rng(seed + 1)
    d = made.dwells
    means, sd = d[["out_x", "out_y", "out_z"]].to_numpy(), d[["sd_x", "sd_y", "sd_z"]].to_numpy()
    first, last = (d["time_s"] - 0.5 * d["duration_s"]).to_numpy(), (d["time_s"] + 0.5 * d["duration_s"]).to_numpy()
    time_s = np.arange(0.0, last[-1], 1.0 / RATE_HZ)
    place = np.clip(np.searchsorted(first, time_s, side="right") - 1, 0, len(d) - 1)
    rows = means[place] + sd[place] * rng.standard_normal((len(time_s), 3))
    moving = time_s > last[place]
    rows[moving] += 400.0 * rng.standard_normal((int(moving.sum()), 3))
    return pd.DataFrame({"time_s": time_s, "x": rows[:, 0], "y": rows[:, 1], "z": rows[:, 2]})
