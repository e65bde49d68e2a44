"""Rest and motion of records turned by hand: `python benchmarks/rest_and_motion.py --runs 12 --seed 1`.

Each record is made by mechanics: a sensor is taken up, turned by a smooth rotation about a random axis while the hand trembles
and shoves it, and put down with a knock; where it lies it feels gravity, and what the row adds: a machine, a draught that warms
it, knocks on the table. The generator knows when it lay still and in which pose; it knows nothing of a search. Prints for each
row the stops made, how many of them were found (`right`), how many were not (`missed`), and how many found stretches are no stop
(`false`): less than half in one stop, or with a mean further from its pose than its samples allow and 2 mg. Rows of positions
`back to back` have no moves between them; `waved` has no rest.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent)]

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402

Floats = NDArray[np.float64]
Spans = list[tuple[int, int]]
_ALLOWED_G, _SIGMAS = 2e-3, 5.0


@dataclass(frozen=True)
class Row:
    """What the records of a row have in common: ranges are drawn from.

    rate_hz : samples in a second · noise_mg : standard deviation of a sample, white · rest_s, move_s : lengths; a move of 0 s is
        none in the record · stops : of a record
    vibration : frequency in Hz and amplitude in g of a machine, and the part of the rests in which it runs
    held : part of the moves that end with some seconds in a steady hand · drift_mg : change of the bias over the record by the
        temperature · knocks : on the table, per rest · counts : the output is in counts of this many per g, with an offset
    """

    rate_hz: tuple[float, ...] = (50.0, 100.0, 200.0)
    noise_mg: tuple[float, ...] = (0.2, 1.0, 5.0)
    rest_s: tuple[float, float] = (2.0, 6.0)
    move_s: tuple[float, float] = (0.7, 2.5)
    stops: int = 20
    vibration: tuple[float, float, float] = (0.0, 0.0, 0.0)
    held: float = 0.0
    drift_mg: float = 0.0
    knocks: float = 0.0
    counts: float = 0.0


_RATES = (20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
_NOISES = (0.05, 0.2, 1.0, 5.0, 20.0)
ROWS: dict[str, Row] = {
    **{f"{rate:g} Hz": Row((rate,)) for rate in _RATES},
    **{f"noise {noise:g} mg": Row(noise_mg=(noise,)) for noise in _NOISES},
    "rests of 9 samples": Row((10.0,), rest_s=(0.9, 0.9), move_s=(0.4, 0.8)),
    "rests of 0.6 to 1 s": Row(rest_s=(0.6, 1.0), move_s=(0.4, 1.0)),
    "rests of 1 to 2 s": Row(rest_s=(1.0, 2.0), move_s=(0.5, 1.5)),
    "rests of 1 to 60 s": Row(rest_s=(1.0, 60.0)),
    "slow moves of 4 to 8 s": Row(move_s=(4.0, 8.0)),
    "held for 1.5 to 3 s in half of the moves": Row(held=0.5),
    "5 Hz 0.05 g in a third of the rests": Row(vibration=(5.0, 0.05, 0.33)),
    "5 Hz 0.05 g in all rests": Row(vibration=(5.0, 0.05, 1.0)),
    "18 Hz 0.02 g in half of the rests": Row(vibration=(18.0, 0.02, 0.5)),
    "50 Hz 0.1 g in half of the rests": Row((200.0, 500.0, 1000.0), vibration=(50.0, 0.1, 0.5)),
    "warms by 30 mg": Row(drift_mg=30.0),
    "knocks on the table": Row(knocks=0.5),
    "counts with an offset": Row(counts=4096.0),
    "back to back, 9 samples": Row((10.0,), rest_s=(0.8, 1.0), move_s=(0.0, 0.0)),
    "back to back, 15 to 60 samples": Row((20.0,), rest_s=(0.75, 3.0), move_s=(0.0, 0.0)),
    "waved": Row(stops=0),
    "waved, counts": Row(stops=0, counts=4096.0),
    "one rest": Row(stops=1, rest_s=(20.0, 60.0)),
    "one rest, 5 Hz 0.05 g": Row(stops=1, rest_s=(20.0, 60.0), vibration=(5.0, 0.05, 1.0)),
}


@dataclass(frozen=True)
class Record:
    """A record: time (n,) in s, output (n, 3), gravity in its unit or None of counts; and the truth.

    rests : first and one past the last sample at rest · poses : (k, 3), mean output there without noise and disturbance
    sd : of a sample at rest, unit of the output · unit : of the output, of 1 g
    """

    time: Floats
    output: Floats
    gravity: float | None
    rests: Spans
    poses: Floats
    sd: float
    unit: float


def made(row: Row, rng: np.random.Generator) -> Record:
    """One record of a row."""
    rate, noise = float(rng.choice(row.rate_hz)), 1e-3 * float(rng.choice(row.noise_mg))
    if not row.stops:
        force, rests = _waved(rate, rng), []
    else:
        force, rests = _turned(row, rate, rng)
    n = len(force)
    time = np.arange(n) / rate
    clean = force @ (np.eye(3) + 0.01 * rng.standard_normal((3, 3))).T + 0.02 * rng.standard_normal(3)
    clean += 1e-3 * row.drift_mg * (1.0 - np.exp(-time / (0.4 * time[-1])))[:, None] * _direction(rng)
    poses = np.array([clean[a:b].mean(axis=0) for a, b in rests]).reshape(-1, 3)
    output = clean + noise * rng.standard_normal((n, 3))
    for a, b in rests:
        if rng.random() < row.vibration[2]:
            output[a:b] += _machine(row.vibration, time[a:b], rng)
        for _ in range(rng.poisson(row.knocks)):
            output[a:b] += _knock(time[a:b], float(rng.uniform(time[a], time[b - 1])), rng)
    sd = max(noise, row.vibration[1] / np.sqrt(2.0))
    if not row.counts:
        return Record(time, output, 1.0, rests, poses, sd, 1.0)
    offset = rng.uniform(-3000.0, 40000.0, 3)
    return Record(
        time,
        np.round(offset + row.counts * output),
        None,
        rests,
        offset + row.counts * poses,
        row.counts * sd,
        row.counts,
    )


def _turned(row: Row, rate: float, rng: np.random.Generator) -> tuple[Floats, Spans]:
    """Force (n, 3) in the sensor, g, of a sensor turned from rest to rest; the spans of the rests."""
    pose = Rotation.random(rng=rng)
    parts: list[Floats] = []
    rests: Spans = []
    n = 0
    for k in range(row.stops):
        if k and row.move_s[1]:
            count = max(1, round(rate * float(rng.uniform(*row.move_s))))
            parts.append(_move(pose, pose := _next(pose, rng), count, rate, rng))
            n += count
            if rng.random() < row.held:
                parts.append(_hold(pose, round(rate * float(rng.uniform(1.5, 3.0))), rate, rng))
                n += len(parts[-1])
        elif k:
            pose = _next(pose, rng)
        count = round(rate * float(rng.uniform(*row.rest_s)))
        parts.append(np.tile(pose.inv().apply([0.0, 0.0, 1.0]), (count, 1)))
        rests.append((n, n + count))
        n += count
    return np.concatenate(parts), rests


def _next(pose: Rotation, rng: np.random.Generator) -> Rotation:
    """Another pose, by a turn of 30 to 180 degrees about an axis that moves the force by 0.3 g at least."""
    while True:
        other = Rotation.from_rotvec(_direction(rng) * rng.uniform(0.5, np.pi)) * pose
        if np.linalg.norm(other.inv().apply([0.0, 0.0, 1.0]) - pose.inv().apply([0.0, 0.0, 1.0])) > 0.3:
            return other


def _move(first: Rotation, last: Rotation, count: int, rate: float, rng: np.random.Generator) -> Floats:
    """Force of a turn of least jerk (Flash, Hogan, J. Neurosci. 5 (1985) 1688) by a hand that trembles, lifts and lowers."""
    s = (np.arange(count) + 0.5) / count
    along = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    turn = (last * first.inv()).as_rotvec()
    tremor = 0.02 * np.sin(2.0 * np.pi * (rng.uniform(7.0, 12.0) * s * count / rate + rng.random(3)[:, None])).T
    tremor *= np.sin(np.pi * s)[:, None]
    pose = Rotation.from_rotvec(along[:, None] * turn + tremor) * first
    duration = count / rate
    reach = rng.uniform(0.05, 0.3) / max(duration, 0.5) ** 2  # m/s² of a way of decimetres, in g with 2π²/9.8
    moved = 2.0 * reach * np.sin(2.0 * np.pi * s)[:, None] * _direction(rng)
    down = rng.uniform(0.1, 0.8) * np.exp(-((1.0 - s) * duration / 0.03))[:, None] * [0.3, 0.3, 1.0]
    return pose.inv().apply(np.array([0.0, 0.0, 1.0]) + moved + down)


def _hold(pose: Rotation, count: int, rate: float, rng: np.random.Generator) -> Floats:
    """Force in a hand that holds the sensor as still as it can: it sways by a degree, and trembles by 20 mg."""
    t = np.arange(count) / rate
    sway = np.radians(rng.uniform(0.5, 1.5)) * _waves(t, (0.3, 2.0), rng)
    return (Rotation.from_rotvec(sway) * pose).inv().apply([0.0, 0.0, 1.0]) + 0.02 * _waves(t, (7.0, 12.0), rng)


def _waves(t: Floats, hz: tuple[float, float], rng: np.random.Generator) -> Floats:
    """Three waves (n, 3) of size 1 of frequencies in a range."""
    return np.stack([np.sin(2.0 * np.pi * (f * t + rng.random())) for f in rng.uniform(*hz, 3)], axis=1)


def _waved(rate: float, rng: np.random.Generator) -> Floats:
    """Force of a sensor that a hand turns to and fro without a rest, 60 s."""
    t = np.arange(round(60.0 * rate)) / rate
    waves = [
        rng.uniform(0.3, 0.9) * np.sin(2.0 * np.pi * (f * t + rng.random())) for f in rng.uniform(0.15, 1.2, 6).tolist()
    ]
    angles = np.stack([waves[0] + waves[3], waves[1] + waves[4], waves[2] + waves[5]], axis=1)
    pose = Rotation.from_rotvec(angles)
    return pose.inv().apply(np.array([0.0, 0.0, 1.0]) + 0.05 * _waves(t, (0.5, 2.0), rng))


def _machine(vibration: tuple[float, float, float], time: Floats, rng: np.random.Generator) -> Floats:
    """A machine that turns almost evenly, with a weaker second harmonic."""
    frequency, size, _ = vibration
    phase = 2.0 * np.pi * frequency * rng.uniform(0.93, 1.07) * time
    way = np.outer(np.sin(phase + 6.3 * rng.random()), _direction(rng))
    return size * (way + 0.2 * np.outer(np.sin(2.0 * phase + 6.3 * rng.random()), _direction(rng)))


def _knock(time: Floats, at: float, rng: np.random.Generator) -> Floats:
    """A table that rings after a knock."""
    since = np.maximum(time - at, 0.0)
    ring = np.sin(2.0 * np.pi * rng.uniform(12.0, 40.0) * since) * np.exp(-since / rng.uniform(0.03, 0.12))
    return rng.uniform(0.05, 0.6) * np.outer(ring, _direction(rng))


def _direction(rng: np.random.Generator) -> Floats:
    way = rng.standard_normal(3)
    return way / np.linalg.norm(way)


def found(record: Record) -> Spans:
    """The stops that the search of an import finds, or the positions back to back that it proposes."""
    from inertial import change_of_level
    from pipelines.importers import stretches

    stops = stretches.found_stops(record.output, record.time, [0, len(record.time)], record.gravity)
    levels = change_of_level.several_levels(record.output) if stops.several else 1
    if stops.several and levels > 1 and 2 * len(stops.several) >= len(stops.found):
        return list(stretches.by_positions(record.output, levels, "").spans)
    return list(stops.found.spans)


def counted(record: Record, spans: Spans) -> tuple[int, int, int]:
    """Stops found, stops not found, stretches that are none."""
    right, false = set[int](), 0
    for a, b in spans:
        inside = [max(0, min(b, d) - max(a, c)) for c, d in record.rests]
        k = int(np.argmax(inside)) if inside else -1
        allowed = _ALLOWED_G * record.unit + _SIGMAS * record.sd / np.sqrt(b - a)
        if k < 0 or 2 * inside[k] < b - a or np.abs(record.output[a:b].mean(axis=0) - record.poses[k]).max() > allowed:
            false += 1
        else:
            right.add(k)
    return len(right), len(record.rests) - len(right), false


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=12, help="records of a row")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="rows with this text in their name")
    given = parser.parse_args()
    print(f"{'row':41} records  stops  right missed  false")
    total = np.zeros(4, dtype=int)
    for number, (name, row) in enumerate(ROWS.items()):
        if given.only not in name:
            continue
        counts = np.zeros(4, dtype=int)
        for k in range(given.runs):
            record = made(row, np.random.default_rng([given.seed, number, k]))
            right, missed, false = counted(record, found(record))
            counts += (len(record.rests), right, missed, false)
        total += counts
        print(f"{name:41} {given.runs:7} {counts[0]:6} {counts[1]:6} {counts[2]:6} {counts[3]:6}", flush=True)
    print(f"{'all':41} {'':7} {total[0]:6} {total[1]:6} {total[2]:6} {total[3]:6}")


if __name__ == "__main__":
    main()
