"""Bias tracked, then left alone: what the filter states and what is true, `python benchmarks/bias_tracking.py --runs 16`.

A sensor of a preset lies still at 100 Hz: half an hour of static record, whose Allan fit gives N, B and K as the product fits
them; ten minutes with known force, one update a second; then no update for up to an hour. White noise, flicker (by fractional
integration, with ten minutes of past) and a random walk go on through all of it; the filter does not know how they were made.
Errors are those of the filter's bias against the bias that was simulated, x, y and z of all runs together.

NEES is the mean of (error / stated)², 1 where the statement is right. Beside it one Gauss–Markov process of standard deviation B
and the time constant of the Allan minimum: the textbook's filter.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from inertial.noise.allan import overlapping  # noqa: E402
from inertial.noise.bias_filter import Track, track  # noqa: E402
from inertial.noise.gauss_markov import AT_MAXIMUM, BiasModel, bias_model, flicker_of_steps  # noqa: E402
from inertial.noise.terms import likely_terms  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402
from tests import made_noise as generate  # noqa: E402

Array = np.ndarray
PRESETS = ("adxl355", "sf1500", "qa700")
RATE = 100
FINE = 4  # values of the flicker in a sample, which is their mean: point values have white noise of their own at the end of 1/f
PAST, RECORD, UPDATES = 600, 1800, 600
GAPS = (0, 60, 600, 3600)


def simulated(preset: Preset, rng: np.random.Generator, walk: float) -> tuple[Array, Array]:
    """Bias and output of one run, (3, n), g, from the beginning of the static record."""
    n = FINE * RATE * (PAST + RECORD + UPDATES + max(GAPS) + 1)
    bias = generate.flicker(rng, (3, n), 1e-6 * preset.bias_instability_ug).reshape(3, -1, FINE).mean(axis=-1)
    bias = bias[:, RATE * PAST :]
    bias = bias + generate.random_walk(rng, bias.shape, 1e-6 * walk * preset.rate_random_walk_ug, RATE)
    return bias, bias + generate.white(rng, bias.shape, 1e-6 * preset.noise_density_ug, RATE)


def means(samples: Array) -> Array:
    """Means over a second, (3, n // 100)."""
    return samples.reshape(3, -1, RATE).mean(axis=-1)


def models(record: Array, turn_on: Array) -> tuple[BiasModel, BiasModel]:
    """The model of the Allan fit of a static record, as the product makes it, and the textbook's."""
    curve = overlapping(record, RATE)
    terms = likely_terms(curve.deviation, curve.m, curve.n, curve.rate_hz)
    own = bias_model(
        terms.white, terms.instability, terms.walk, turn_on, flicker_of_steps(1.0, float(UPDATES + max(GAPS)))
    )
    lowest = curve.tau[np.argmin(np.median(curve.deviation, axis=0))]
    plain = BiasModel(
        terms.white, terms.instability[:, None], np.array([lowest / AT_MAXIMUM]), np.zeros(3), np.zeros(3)
    )
    return own, plain


def tracked(model: BiasModel, output: Array) -> Track:
    """Updates for ten minutes, and the bias at each of the gaps after them."""
    steps = np.concatenate([np.arange(UPDATES), UPDATES - 1 + np.array(GAPS[1:])])
    known = np.full((len(steps), 3), np.nan)
    known[:UPDATES] = 0.0
    return track(model, steps.astype(np.float64), output[steps], known, np.full(len(steps), np.nan), 1.0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=16)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--walk", type=float, default=1.0, help="multiple of the preset's random walk")
    parser.add_argument("--preset", action="append", choices=PRESETS)
    options = parser.parse_args()
    print(
        "bias after ten minutes of updates and then none, µg: stated (rms), true error (rms), NEES, share within 2 sd, %"
    )
    heads = ("device", "no update", "stated", "true", "NEES", "in 2 sd", "textbook", "its true", "its NEES")
    print("{:8} {:>10} {:>8} {:>8} {:>6} {:>8} {:>9} {:>9} {:>9}".format(*heads))
    for name in options.preset or PRESETS:
        preset, rng = load_preset(name), np.random.default_rng([options.seed, PRESETS.index(name)])
        errors, stated, nis = ([], []), ([], []), []
        for _ in range(options.runs):
            bias, samples = simulated(preset, rng, options.walk)
            record = samples[:, : RATE * RECORD]
            bias, output = means(bias), means(samples)
            truth = bias[:, RECORD:].T - bias[:, :RECORD].mean(
                axis=1
            )  # the calibration has taken the mean of the record
            seen = output[:, RECORD:].T - bias[:, :RECORD].mean(axis=1)
            turn_on = np.full(3, 3e-6 * preset.bias_instability_ug)
            for kind, model in enumerate(models(record, turn_on)):
                bias_track = tracked(model, seen)
                at = [UPDATES - 1, *range(UPDATES, UPDATES + len(GAPS) - 1)]
                real = truth[UPDATES - 1 + np.array(GAPS)]
                errors[kind].append(bias_track.bias[at] - real)
                stated[kind].append(np.sqrt(np.diagonal(bias_track.covariance[at], axis1=1, axis2=2)))
                if kind == 0:
                    nis.append(bias_track.consistency)
        e, s = ([1e6 * np.array(part) for part in pair] for pair in (errors, stated))
        for g, gap in enumerate(GAPS):
            row = [name, f"{gap} s"]
            for kind in (0, 1):
                pull = e[kind][:, g] / s[kind][:, g]
                row += [f"{np.sqrt(np.mean(v[:, g] ** 2)):.1f}" for v in (s[kind], e[kind])]
                row.append(f"{np.mean(pull**2):.2f}")
                if kind == 0:
                    row.append(f"{100 * np.mean(np.abs(pull) < 2):.1f}")
            print("{:8} {:>10} {:>8} {:>8} {:>6} {:>8} {:>9} {:>9} {:>9}".format(*row), flush=True)
        print(
            f"{'':8} NIS mean {np.mean([one.nis for one in nis]):.3f}, stated "
            + ", ".join(
                f"{kind}: {sum(one.stated == kind for one in nis)}" for kind in ("consistent", "too large", "too small")
            )
            + f" of {len(nis)} runs"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
