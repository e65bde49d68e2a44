"""Batch fit against a loop of least squares, and against imucal on six faces: `python benchmarks/fits.py`.

The loop is the textbook one: for each unit and axis, stack the poses and call `numpy.linalg.lstsq`. All three
run in one process on one thread; each figure is the best of several rounds. With `--worker` it is a process like those of a
re-fit, which keep the memory of their arrays (`pipelines.parallel`).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from inertial import poses  # noqa: E402
from inertial.fits.faces import ferraris  # noqa: E402
from inertial.fits.linear import fit_lot  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from inertial.state import State  # noqa: E402
from pipelines.parallel import one_thread_each  # noqa: E402

LINEAR = ("bias", "scale", "misalignment")
THERMAL = (
    *LINEAR,
    "bias_temperature",
    "bias_temperature_quadratic",
    "scale_temperature",
    "scale_temperature_quadratic",
)
Array = np.ndarray


def best(function: Callable[[], object], rounds: int) -> float:
    """Shortest processor time of a call, s: all of it is in this one thread."""
    times: list[float] = []
    for _ in range(rounds):
        start = time.process_time()
        function()
        times.append(time.process_time() - start)
    return min(times)


def lot(units: int, rng: np.random.Generator) -> tuple[State, Array, Array]:
    """State of 72 dwells (24 poses at 3 temperatures, read by the thermometer of each unit), force, output."""
    angles = np.radians(poses.plan("fibonacci24"))
    force = np.tile(force_from_angles(angles[:, 0], angles[:, 1]), (3, 1))
    heat = np.repeat([-20.0, 25.0, 60.0], 24) + rng.normal(scale=0.5, size=(units, 72))
    k = np.eye(3) + 3e-3 * rng.normal(size=(units, 3, 3))
    out = np.einsum("uij,nj->uni", k, force) + 8e-3 * rng.normal(size=(units, 1, 3))
    out = (
        out + 50e-6 * rng.normal(size=(units, 1, 3)) * (heat - 25.0)[..., None] + 1e-5 * rng.normal(size=(units, 72, 3))
    )
    state = State(force=np.broadcast_to(force, (units, 72, 3)), time=np.arange(72.0) * 30.0, temperature=heat)
    return state, force, out


def loop_linear(force: Array, out: Array, error: Array | None = None) -> Array:
    """The textbook method: twelve unknowns, unit by unit and axis by axis."""
    solution = np.empty((len(out), 3, 4))
    for u in range(len(out)):
        for axis in range(3):
            h = np.column_stack([np.ones(len(force)), force])
            z = out[u, :, axis]
            if error is not None:
                h, z = h / error[u, :, axis, None], z / error[u, :, axis]
            solution[u, axis] = np.linalg.lstsq(h, z, rcond=None)[0]
    return solution


def loop_thermal(force: Array, out: Array, heat: Array) -> Array:
    """The same with the thermal terms of an axis."""
    solution = np.empty((len(out), 3, 8))
    for u in range(len(out)):
        theta = heat[u] - 25.0
        for axis in range(3):
            f = force[:, axis]
            h = np.column_stack([np.ones(len(f)), force, theta, theta**2, theta * f, theta**2 * f])
            solution[u, axis] = np.linalg.lstsq(h, out[u, :, axis], rcond=None)[0]
    return solution


def with_imucal(up: Array, down: Array, samples: int) -> Callable[[], None]:
    """Peer: imucal's Ferraris calibration, unit by unit, on records of `samples` samples per face."""
    import warnings

    from imucal import FerrarisCalibration
    from imucal.ferraris_calibration import FerrarisSignalRegions

    still = np.zeros((samples, 3))

    def region(means: Array) -> Array:
        return np.broadcast_to(means, (samples, 3))

    def run() -> None:
        for p, a in zip(up, down, strict=True):
            acc = {f"acc_{ax}_{w}": region(m[k]) for w, m in (("p", p), ("a", a)) for k, ax in enumerate("xyz")}
            gyr = {f"gyr_{ax}_{w}": still for w in "pa" for ax in "xyz"}
            turns = {f"gyr_{ax}_rot": np.tile(np.eye(3)[k], (samples, 1)) for k, ax in enumerate("xyz")}
            turns |= {f"acc_{ax}_rot": region(p[k]) for k, ax in enumerate("xyz")}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                FerrarisCalibration(grav=1.0).compute(
                    FerrarisSignalRegions(**acc, **gyr, **turns), 100.0, "a.u.", "a.u."
                )

    return run


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--worker", action="store_true", help="in a process like those of a re-fit")
    options = parser.parse_args()
    if options.worker:
        with one_thread_each(), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as worker:
            worker.submit(measured, options).result()
    else:
        measured(options)


def measured(options: argparse.Namespace) -> None:
    """All comparisons."""
    rng = np.random.default_rng(1)
    state, force, out = lot(options.units, rng)
    error = np.full_like(out, 1e-5)
    print(f"python benchmarks/fits.py --units {options.units} --rounds {options.rounds}")
    print(f"{options.units} units × 72 dwells × 3 axes, one thread, best of {options.rounds}; loop: numpy.linalg.lstsq")
    heat = np.asarray(state.temperature)
    plan = State(force=force, time=state.time)
    common = State(force=force, time=state.time, temperature=heat[0])
    rows = (
        ("linear, one plan for the lot", LINEAR, plan, None, lambda: loop_linear(force, out)),
        ("linear, weights by unit", LINEAR, state, error, lambda: loop_linear(force, out, error)),
        (
            "thermal, one temperature",
            THERMAL,
            common,
            None,
            lambda: loop_thermal(force, out, np.broadcast_to(heat[:1], heat.shape)),
        ),
        ("thermal, by unit", THERMAL, state, None, lambda: loop_thermal(force, out, heat)),
    )
    for name, effects, where, weight, loop in rows:

        def batch(effects: tuple[str, ...] = effects, where: State = where, weight: Array | None = weight) -> Array:
            return fit_lot(effects, where, out, weight).coefficients

        fast, slow = best(batch, options.rounds), best(loop, max(1, options.rounds // 2))
        off = np.abs(np.sort(batch()) - np.sort(loop())).max()
        print(
            f"{name:<30} batch {1e3 * fast:7.1f} ms   loop {1e3 * slow:7.1f} ms   ratio {slow / fast:6.1f}   difference {off:.0e}"
        )
    six(options.units, options.rounds, rng)


def six(units: int, rounds: int, rng: np.random.Generator) -> None:
    """Six faces: closed form for the lot, fit_lot, imucal."""
    k = 200.0 * (np.eye(3) + 3e-3 * rng.normal(size=(units, 3, 3)))
    bias = rng.normal(size=(units, 1, 3))
    up, down = np.swapaxes(k, 1, 2) + bias, -np.swapaxes(k, 1, 2) + bias
    peer = with_imucal(up, down, 100)
    faces = np.concatenate([np.eye(3), -np.eye(3)])
    state, out = State(force=faces, time=np.arange(6.0)), np.concatenate([up, down], axis=1)
    closed = best(lambda: ferraris(up, down, 1.0), rounds)
    batch = best(lambda: fit_lot(LINEAR, state, out), rounds)
    own_loop = best(lambda: [ferraris(p, a, 1.0) for p, a in zip(up, down, strict=True)], rounds)
    slow = best(peer, 1)
    print(f"six faces, {units} units: imucal {1e3 * slow:.1f} ms (100 samples a face, with its gyroscope part)")
    for name, took in (("fit_lot", batch), ("closed form", closed), ("own loop of the published method", own_loop)):
        print(f"  {name:<34} {1e3 * took:8.2f} ms   ratio {slow / took:8.1f}")


if __name__ == "__main__":
    main()
