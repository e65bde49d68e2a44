"""``python -m benchmarks.procedures``: hidden effects in sweeps, null sweeps, bad points, pulls, time of a lot of eight.

The truth is computed independently of the product's effects: filters by scipy, sums over a period, records in time.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import signal

from inertial.dynamics.sine_fit import fit_tone
from inertial.dynamics.transfer_diagnosis import diagnose_transfer
from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_model import Points, fit_transfer

MAGNITUDE, PHASE = 2e-3, 2e-3  # standard uncertainty of a point: share, rad
LOOKED_FOR = 2.0  # rms weighted residual that the hidden effect leaves in the judged model: twice the floor
MODEL = ("second_order", "delay")


def conditions(rng: np.random.Generator, kind: str) -> Conditions:
    """Points from 5 Hz to 5 kHz; one on the mains, several levels, or a drifting temperature where the effect needs it."""
    f = np.geomspace(5.0, 5000.0, 60)
    if kind == "hum":
        f = np.sort(np.concatenate([f, [50.0, 50.3]]))
    level, drift = np.ones(f.size), np.full(f.size, 25.0)
    if kind == "amplitude":
        f, level = np.concatenate([f, np.full(5, 160.0)]), np.concatenate([level, np.geomspace(0.2, 5.0, 5)])
        drift = np.full(f.size, 25.0)
    if kind == "temperature":
        drift = 25.0 + np.cumsum(rng.normal(size=f.size))
    return Conditions(f, level, drift, np.ones(f.size))


def sensor(c: Conditions, rng: np.random.Generator, *, late: bool = True) -> np.ndarray:
    """Response of a random sensor by scipy, with a delay."""
    w0, zeta, delay = 2.0 * np.pi * rng.uniform(1800.0, 3000.0), rng.uniform(0.55, 0.75), rng.uniform(5e-6, 60e-6)
    w = 2.0 * np.pi * c.frequency
    h = signal.freqs([w0**2], [1.0, 2.0 * zeta * w0, w0**2], w)[1]
    return h * np.exp(-1j * w * delay) if late else h


def hidden(kind: str, c: Conditions, knob: float, rng: np.random.Generator) -> np.ndarray:  # noqa: PLR0911 - one a kind
    """Factor of an effect; ``knob`` from 0 (none) makes it larger."""
    w = 2.0 * np.pi * c.frequency
    if kind in {"one_pole", "two_pole"}:
        b, a = signal.butter(1 if kind == "one_pole" else 2, 2.0 * np.pi * 4000.0 / knob, analog=True)
        return signal.freqs(b, a, w)[1]
    if kind == "moving_average":
        taps = max(2, round(knob * 1e-4 * 2e6))
        return signal.freqz(np.ones(taps) / taps, worN=c.frequency, fs=2e6)[1]
    if kind == "delay":
        return np.exp(-1j * w * 1e-5 * knob)
    if kind == "mounting_resonance":
        wm, zm = 2.0 * np.pi * 9000.0 / knob, 0.03
        return signal.freqs([2.0 * zm * wm, wm**2], [1.0, 2.0 * zm * wm, wm**2], w)[1]
    if kind == "second_mode":
        w2, z2 = 2.0 * np.pi * rng.uniform(900.0, 3500.0), 0.03
        return 1.0 - signal.freqs([0.01 * knob, 0.0, 0.0], [1.0, 2.0 * z2 * w2, w2**2], w)[1]
    if kind == "own_clock":
        out = []
        for f in c.frequency:
            rate = max(50.0, 8.0 * f)
            t = np.arange(int(rate)) / rate
            out.append(fit_tone(np.cos(2.0 * np.pi * f * (1.0 + 1e-5 * knob) * t)[:, None], rate, float(f)).value[0])
        return np.array(out)
    if kind == "hum":
        t = np.arange(4000) / 4000.0
        out = [
            fit_tone(
                (np.cos(2.0 * np.pi * f * t) + 0.01 * knob * np.cos(2.0 * np.pi * 50.0 * t + 1.0))[:, None],
                4000.0,
                float(f),
            ).value[0]
            if f < 1000.0
            else 1.0
            for f in c.frequency
        ]
        return np.array(out)
    if kind == "amplitude":
        turn = 2.0 * np.pi * np.arange(64) / 64
        one = [np.fft.rfft(a * np.cos(turn) + 1e-3 * knob * (a * np.cos(turn)) ** 3)[1] / (32.0 * a) for a in c.level]
        return np.array(one)
    return 1.0 + 1e-4 * knob * (c.temperature - 25.0)


def points_of(c: Conditions, truth: np.ndarray, rng: np.random.Generator | None) -> Points:
    """Points with their noise; without noise where there is no generator."""
    n = truth.size
    noise = np.zeros(n) if rng is None else MAGNITUDE * rng.normal(size=n) + 1j * PHASE * rng.normal(size=n)
    return Points(c, truth * np.exp(noise), np.full(n, MAGNITUDE), np.full(n, PHASE))


def at_twice_the_floor(kind: str, rng: np.random.Generator) -> tuple[Points, tuple[str, ...]]:
    """A sweep whose hidden effect leaves twice the floor in the judged model."""
    model = ("second_order",) if kind == "delay" else MODEL
    c = conditions(rng, kind)
    clean, state = sensor(c, rng, late=kind != "delay"), rng.bit_generator.state
    low, high = np.log(1e-3), np.log(3e3)

    def truth(knob: float) -> np.ndarray:
        rng.bit_generator.state = state
        return clean * hidden(kind, c, knob, rng)

    for _ in range(14):
        middle = 0.5 * (low + high)
        fit = fit_transfer(points_of(c, truth(float(np.exp(middle))), None), model)
        left = np.sqrt(fit.chi_square / len(fit.residual))
        low, high = (middle, high) if left < LOOKED_FOR else (low, middle)
    return points_of(c, truth(float(np.exp(high))), rng), model


KINDS = (
    *("one_pole", "two_pole", "moving_average", "delay", "mounting_resonance"),
    *("second_mode", "own_clock", "hum", "amplitude", "temperature"),
)


def naming(n: int, seed: int) -> None:
    """Hidden effects that are named in a class, by kind."""
    hits: dict[str, list[bool]] = {kind: [] for kind in KINDS}
    for k in range(n):
        kind = KINDS[k % len(KINDS)]
        rng = np.random.default_rng([seed, k])
        points, model = at_twice_the_floor(kind, rng)
        diagnosis = diagnose_transfer(points, model)
        hits[kind].append(any(kind in one.effects for one in diagnosis.classes))
        print(f"  {k + 1} of {n}, named: {sum(map(sum, hits.values()))}", flush=True)  # a stop keeps what was counted
        if not hits[kind][-1]:
            print(
                f"  missed {kind}: p {diagnosis.fit.p_value:.2g}, {[one.effects for one in diagnosis.classes]}",
                flush=True,
            )
    whole = sum(map(sum, hits.values()))
    print(
        f"hidden effects named in a class: {whole} of {n}; "
        + ", ".join(f"{k} {sum(v)}/{len(v)}" for k, v in hits.items()),
        flush=True,
    )


def null(n: int, seed: int) -> None:
    """Sweeps without a hidden effect in which something is named, and the pulls of natural frequency, damping and delay."""
    named, pulls = 0, []
    for k in range(n):
        rng = np.random.default_rng([seed, 7, k])
        c = conditions(rng, KINDS[k % len(KINDS)])
        before = rng.bit_generator.state
        truth = sensor(c, rng)
        after = rng.bit_generator.state
        rng.bit_generator.state = before
        w0, zeta, delay = rng.uniform(1800.0, 3000.0), rng.uniform(0.55, 0.75), rng.uniform(5e-6, 60e-6)
        rng.bit_generator.state = after
        diagnosis = diagnose_transfer(points_of(c, truth, rng), MODEL)
        named += bool(diagnosis.classes)
        print(f"  null {k + 1} of {n}, named: {named}", flush=True)
        true = {"natural_hz": w0, "damping": zeta, "delay_s": delay}
        pulls.append([(diagnosis.fit.of(p)[0] - t) / diagnosis.fit.of(p)[1] for p, t in true.items()])
    spread = np.std(np.array(pulls), axis=0, ddof=1)
    print(f"null sweeps in which an effect is named: {named} of {n}", flush=True)
    print(
        "standard deviation of the pulls: "
        + ", ".join(f"{p} {s:.3f}" for p, s in zip(("f_n", "ζ", "delay"), spread, strict=True)),
        flush=True,
    )


def bad(n: int, seed: int) -> None:
    """Sweeps without a hidden effect of which one point is off by 8 to 40 times its uncertainty: told as that, or named."""
    told = named = 0
    for k in range(n):
        rng = np.random.default_rng([seed, 13, k])
        c = conditions(rng, "delay")
        points = points_of(c, sensor(c, rng), rng)
        at, size = int(rng.integers(points.value.size)), MAGNITUDE * rng.uniform(8.0, 40.0)
        points.value[at] *= np.exp(size * np.exp(2j * np.pi * rng.uniform()))
        diagnosis = diagnose_transfer(points, MODEL)
        told += diagnosis.alone_hz == (points.conditions.frequency[at],)
        named += bool(diagnosis.classes)
    print(f"sweeps with a bad point: told {told} of {n}, an effect named {named}", flush=True)


def lot_of_eight() -> None:
    """Time of a lot of eight through sweep, shock and stability on the simulated station."""
    from pipelines.archive import Archive
    from pipelines.chain.runner import Runner
    from pipelines.jobs.job import Request

    with tempfile.TemporaryDirectory() as folder:
        recipe, limits = Path(folder) / "lot.toml", Path(folder) / "limits.toml"
        limits.write_text('name = "lot"\n[figures]\nshock_bias_shift_ug = { max = 5000.0, unit = "µg" }\n')
        units = ", ".join(f'"L{k}"' for k in range(8))
        recipe.write_text(
            f'name = "eight"\ndevice = "SF1500"\nunits = [{units}]\nlocal_gravity_m_s2 = 9.80665\ntemperatures_C = [25.0]\n'
            'limits = "limits.toml"\n[[procedures]]\nkind = "sweep"\nhigh_hz = 3000.0\nlevel_g = 2.0\nnominal_scale = 0.007\n'
            '[[procedures]]\nkind = "shock"\nscale = 0.007\n[[procedures]]\nkind = "bias_stability"\nscale = 0.007\n'
        )
        archive = Archive(str(Path(folder) / "archive"))
        begun, cpu = time.perf_counter(), time.process_time()
        runner = Runner(Request(str(recipe)).job(archive), archive)
        for done in runner.all():
            print(f"  {done.stage:<10} {done.seconds:6.1f} s", flush=True)
        print(
            f"lot of eight: {time.perf_counter() - begun:.1f} s, processor {time.process_time() - cpu:.1f} s",
            flush=True,
        )


WHAT: dict[str, Callable[[int, int], None]] = {"naming": naming, "null": null, "bad": bad}


def main() -> None:
    """Everything, or what is named: ``naming``, ``null``, ``bad`` or ``lot``, with n sweeps each and a seed."""
    what = sys.argv[1] if len(sys.argv) > 1 else "all"
    n = int(sys.argv[2]) if len(sys.argv) > 2 else 100
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 2026
    for name, run in WHAT.items():
        if what in {"all", name}:
            run(n, seed)
    if what in {"all", "lot"}:
        lot_of_eight()


if __name__ == "__main__":
    main()
