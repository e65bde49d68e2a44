"""Coefficients from logs of flights, rides and wear, against the truth: `python benchmarks/field.py --runs 40 --seed 1`.

Each log is made by mechanics: a wrist that rests and moves and breathes, a pilot who lays a vehicle on its sides and then flies
it, a telephone that is put down at the stops of a ride. A sensor with bias, scale factors, angles between its axes, their run
with temperature, white and 1/f noise reads it. The log is given to the recognition and fit of `tumbleline improve` as a file,
and nothing is said of it. Prints for each kind how many logs gave coefficients, which part of the biases and scale factors lies
within U (k = 2) of the truth, all and by quantity, and the median U of each in 10⁻⁶ (µg, ppm). Kinds that do not determine the
axes (level flight, a telephone in its holder, a logger on a desk) have to be refused: their row counts scale factors that were
stated.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import warnings
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from numpy.typing import NDArray  # noqa: E402
from scipy import stats  # noqa: E402
from scipy.spatial.transform import Rotation, Slerp  # noqa: E402

Floats = NDArray[np.float64]
REFERENCE_C = 25.0


@dataclass(frozen=True)
class Motion:
    """A log without the errors of a sensor: time (n,), s; force (n, 3), g; temperature (n,), °C, or none."""

    time: Floats
    force: Floats
    heat: Floats | None


@dataclass(frozen=True)
class Sensor:
    """Bias (3,) g and response (3, 3) at 25 °C, with their changes in a kelvin; noise of a sample, white and 1/f, g."""

    bias: Floats
    response: Floats
    bias_K: Floats
    scale_K: Floats
    white: float
    flicker: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Sensor:
        """A sensor of a telephone, an autopilot or a wristband."""
        angles = 0.005 * rng.standard_normal((3, 3))
        return cls(
            bias=0.03 * rng.standard_normal(3),
            response=np.diag(1.0 + 0.01 * rng.standard_normal(3)) + np.tril(angles, -1) + np.triu(angles, 1),
            bias_K=3e-4 * rng.standard_normal(3),
            scale_K=5e-5 * rng.standard_normal(3),
            white=float(rng.choice([1e-3, 2e-3, 4e-3])),
            flicker=float(rng.choice([2e-5, 5e-5])),
        )

    def read(self, motion: Motion, rng: np.random.Generator) -> Floats:
        """The output (n, 3), g."""
        theta = np.zeros(len(motion.time)) if motion.heat is None else motion.heat - REFERENCE_C
        output = motion.force @ self.response.T * (1.0 + theta[:, None] * self.scale_K)
        output += self.bias + theta[:, None] * self.bias_K
        output += self.white * rng.standard_normal(output.shape) + self.flicker * _flicker(len(output), rng)
        return np.round(output * 8192.0) / 8192.0


def _flicker(n: int, rng: np.random.Generator) -> Floats:
    """1/f noise (n, 3) of a standard deviation of about one in a decade, by a filter in frequency."""
    spectrum = np.fft.rfft(rng.standard_normal((n, 3)), axis=0)
    f = np.maximum(np.arange(len(spectrum)), 1.0)
    series = np.fft.irfft(spectrum / np.sqrt(f)[:, None], n, axis=0) * np.sqrt(n)
    return series - series.mean(axis=0)


def _poses(
    rng: np.random.Generator, rate: float, rests: list[float], moves: list[float], poses: Rotation, shove: float
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Time, force and whether it rests, of a sensor taken from pose to pose with shoves of a hand, g."""
    ends = np.cumsum(np.ravel(np.column_stack([rests, moves])))[:-1]
    times = np.concatenate([[0.0], ends])
    time = np.arange(0.0, times[-1], 1.0 / rate)
    path = Slerp(times, Rotation.from_quat(np.repeat(poses.as_quat(), 2, axis=0)))(time)
    rest = np.searchsorted(times, time, side="right") % 2 == 1
    pushed = shove * _smooth(rng.standard_normal((len(time), 3)), max(1, round(0.15 * rate)))
    world = np.array([0.0, 0.0, 1.0]) + np.where(rest[:, None], 0.0, pushed)
    return time, path.inv().apply(world), rest


def _smooth(x: Floats, width: int) -> Floats:
    kernel = np.hanning(width + 2)[1:-1]
    return np.column_stack([np.convolve(column, kernel / np.sqrt(np.sum(kernel**2)), "same") for column in x.T])


def wear(rng: np.random.Generator) -> Motion:
    """A wrist for an hour: it lies in a pose for seconds or minutes, breathes with the body, and moves between."""
    count = int(rng.integers(40, 80))
    rests = np.exp(rng.uniform(np.log(6.0), np.log(60.0), count)).tolist()
    time, force, rest = _poses(
        rng, 25.0, rests, rng.uniform(3.0, 20.0, count).tolist(), Rotation.random(count, rng=rng), 0.3
    )
    breath = 2e-3 * np.sin(2.0 * np.pi * 0.25 * time)[:, None] * rng.standard_normal(3)
    heat = 28.0 + 5.0 * (1.0 - np.exp(-time / 900.0)) + np.sin(2.0 * np.pi * time / 1700.0)
    return Motion(time, force + np.where(rest[:, None], breath, 0.0), heat)


def handled_flight(rng: np.random.Generator) -> Motion:
    """A vehicle that is laid on its sides and edges by hand before a flight with its vibration."""
    before = _poses(
        rng, 100.0, rng.uniform(3.0, 7.0, 18).tolist(), rng.uniform(1.5, 4.0, 18).tolist(), _placed(18, rng), 0.2
    )
    flight = level_flight(rng)
    time = np.concatenate([before[0], before[0][-1] + 0.01 + flight.time])
    return Motion(time, np.concatenate([before[1], flight.force]), 30.0 + 6.0 * (1.0 - np.exp(-time / 300.0)))


def level_flight(rng: np.random.Generator) -> Motion:
    """A vehicle at rest on its feet, minutes of flight in turns and gusts, and at rest on its feet again."""
    time = np.arange(0.0, 200.0, 0.01)
    flies = (time > 15.0) & (time < 185.0)
    lean = 0.25 * _smooth(rng.standard_normal((len(time), 3)), 150) / 3.0
    force = Rotation.from_rotvec(np.where(flies[:, None], lean, 0.0)).apply([0.0, 0.0, 1.0])
    shaken = 0.3 * np.sin(2.0 * np.pi * 41.0 * time)[:, None] * rng.standard_normal(3)
    shaken = shaken + 0.15 * rng.standard_normal((len(time), 3))
    return Motion(time, force + np.where(flies[:, None], shaken, 0.0), 30.0 + 4.0 * (1.0 - np.exp(-time / 300.0)))


def ride(rng: np.random.Generator) -> Motion:
    """A telephone that is laid down anyhow at the stops of a ride, beside a running engine."""
    count = int(rng.integers(20, 36))
    time, force, rest = _poses(
        rng, 50.0, rng.uniform(4.0, 20.0, count).tolist(), rng.uniform(5.0, 20.0, count).tolist(),
        Rotation.random(count, rng=rng), 0.4,
    )  # fmt: skip
    engine = 0.01 * np.sin(2.0 * np.pi * 13.0 * time)[:, None] * rng.standard_normal(3)
    return Motion(time, force + np.where(rest[:, None], engine, 0.0), None)


def ride_in_holder(rng: np.random.Generator) -> Motion:
    """A telephone in its holder: it stands and drives, and never turns over."""
    time = np.arange(0.0, 400.0, 0.02)
    drives = np.sin(2.0 * np.pi * time / 40.0 + 6.3 * rng.random()) > -0.3
    pushed = 0.15 * _smooth(rng.standard_normal((len(time), 3)), 25)
    force = Rotation.random(rng=rng).apply(np.array([0.0, 0.0, 1.0]) + np.where(drives[:, None], pushed, 0.0))
    return Motion(time, force, None)


def desk(rng: np.random.Generator) -> Motion:
    """A logger that lies on a desk and is turned over a few times."""
    time, force, _ = _poses(
        rng, 25.0, rng.uniform(30.0, 120.0, 4).tolist(), [2.0] * 4, Rotation.random(4, rng=rng), 0.2
    )
    return Motion(time, force, 24.0 + 0.3 * np.sin(time / 200.0))


def _placed(count: int, rng: np.random.Generator) -> Rotation:
    """Poses with a face or an edge down, as a hand puts them."""
    about = Rotation.from_quat(Rotation.create_group("O").as_quat()[rng.integers(24, size=count)])
    return Rotation.from_rotvec(rng.choice([0.1, 0.8], (count, 1)) * rng.standard_normal((count, 3))) * about


Kind = Callable[[np.random.Generator], Motion]
SEEN: dict[str, Kind] = {"wear": wear, "handled flight": handled_flight, "ride": ride}
UNSEEN: dict[str, Kind] = {"level flight": level_flight, "ride in a holder": ride_in_holder, "on a desk": desk}


def coefficients(motion: Motion, output: Floats, folder: Path) -> tuple[pd.DataFrame | None, float | None, str]:
    """The coefficients that an import of the log gives, °C for :func:`pulls`, and what it says; None where it is refused."""
    from pipelines.archive import Archive
    from pipelines.importers import limited
    from pipelines.improvement.recording import bring_in
    from schemas.errors import TumblelineError

    table = pd.DataFrame({"time_s": motion.time, **dict(zip(["acc_x", "acc_y", "acc_z"], output.T, strict=True))})
    if motion.heat is not None:
        table["temperature"] = np.round(motion.heat, 2)
    path = folder / "log.csv"
    table.to_csv(path, index=False, float_format="%.6f")
    limited.start()
    try:
        done = bring_in([path], str(folder / "archive"), lambda _: nullcontext())
    except TumblelineError as problem:
        return None, None, str(problem)
    if done is None or done["fit"] != "norm":
        return None, None, "no fit"
    said = next((line for line in done["lines"] if "adequate" in line.lower()), "")
    run = Archive(str(folder / "archive")).run(done["run"])
    table, dwells = run.table("coefficients"), run.table("dwells")
    plain = "unit_C" in dwells and not (table["effect"] == "bias_temperature").any()
    return table, float(dwells["unit_C"].mean()) if plain else None, said


def pulls(table: pd.DataFrame, sensor: Sensor, warm: float | None) -> dict[str, Floats]:
    """Errors over U, and U (k = 2), of the biases and scale factors, (n, 2) by quantity; K is zero below its diagonal.

    warm : °C at the rests, where the model has no terms in temperature, so that its values are those there; None elsewhere
    """
    theta = 0.0 if warm is None else warm - REFERENCE_C
    response = sensor.response * (1.0 + theta * sensor.scale_K)[:, None]
    upper = np.linalg.cholesky((response @ response.T)[::-1, ::-1])[::-1, ::-1]
    truth = {("bias", axis): sensor.bias[k] + theta * sensor.bias_K[k] for k, axis in enumerate("xyz")}
    truth |= {("scale", axis): upper[k, k] for k, axis in enumerate("xyz")}
    rows = table[table["effect"].isin(["bias", "scale"])]
    found: dict[str, list[tuple[float, float]]] = {"bias": [], "scale": []}
    for row in rows.to_dict("records"):
        wide = 2.0 * row["standard_error"]
        found[row["effect"]].append(((row["value"] - truth[row["effect"], row["axis"]]) / wide, wide))
    return {name: np.array(values) for name, values in found.items()}


def interval(hits: int, runs: int) -> str:
    """A rate with its Clopper-Pearson interval."""
    limits = stats.binomtest(hits, runs).proportion_ci(0.95, "exact")
    return f"{hits}/{runs} = {100.0 * hits / runs:.1f} % [{100.0 * limits.low:.0f}, {100.0 * limits.high:.0f}]"


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds with this text in their name")
    parser.add_argument("--verbose", action="store_true", help="what each log gave")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    for number, (name, kind) in enumerate({**SEEN, **UNSEEN}.items()):
        if given.only not in name:
            continue
        gave, errors = 0, {"bias": [], "scale": []}
        for k in range(given.runs):
            rng = np.random.default_rng([given.seed, number, k])
            sensor, motion = Sensor.drawn(rng), kind(rng)
            with tempfile.TemporaryDirectory() as folder:
                table, warm, said = coefficients(motion, sensor.read(motion, rng), Path(folder))
            own = {} if table is None else pulls(table, sensor, warm)
            gave += table is not None
            for quantity, values in own.items():
                errors[quantity] += values.tolist()
            if given.verbose:
                print(
                    k,
                    {quantity: np.round(values[:, 0], 2).tolist() for quantity, values in own.items()},
                    said,
                    flush=True,
                )
        if name in UNSEEN:
            print(f"{name}: {given.runs} logs, scale factors stated in {gave}", flush=True)
            continue
        found = {quantity: np.array(values) for quantity, values in errors.items() if values}
        within = {quantity: np.abs(values[:, 0]) <= 1.0 for quantity, values in found.items()}
        every = np.concatenate([*within.values()])
        said = ", ".join(
            f"{quantity} {interval(int(w.sum()), len(w))} (median U {1e6 * np.median(found[quantity][:, 1]):.0f})"
            for quantity, w in within.items()
        )
        print(
            f"{name}: {given.runs} logs, coefficients of {gave}; within U {100.0 * every.mean():.1f} %: {said}",
            flush=True,
        )


if __name__ == "__main__":
    main()
