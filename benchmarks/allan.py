"""Overlapping Allan deviation against allantools: `python benchmarks/allan.py`."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import allantools  # noqa: E402
import numpy as np  # noqa: E402

from inertial.noise.allan import overlapping  # noqa: E402
from inertial.noise.terms import fit_terms  # noqa: E402
from tests import made_noise as generate  # noqa: E402

RATE = 100.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--channels", type=int, default=24)
    parser.add_argument("--minutes", type=float, default=20.0)
    options = parser.parse_args()
    n = int(options.minutes * 60 * RATE)
    rng = np.random.default_rng(1)
    x = generate.white(rng, (options.channels, n), 25e-6, RATE) + generate.flicker(rng, (options.channels, n), 30e-6)
    print(f"python benchmarks/allan.py --channels {options.channels} --minutes {options.minutes:g}")
    start = time.perf_counter()
    curve = overlapping(x, RATE)
    ours = time.perf_counter() - start
    start = time.perf_counter()
    peers = [allantools.oadev(row, rate=RATE, data_type="freq", taus=curve.tau)[1] for row in x]
    values = time.perf_counter() - start
    start = time.perf_counter()
    for row, expected in zip(x, peers, strict=True):
        for m, deviation in zip(curve.m, expected, strict=True):
            alpha = int(np.round(allantools.autocorr_noise_id(row, int(m), data_type="freq")[0])) if n // m >= 30 else 0
            edf = allantools.edf_greenhall(
                int(np.clip(alpha, -2, 2)), 2, int(m), n + 1, overlapping=True, modified=False
            )
            allantools.confidence_interval(deviation, edf)
    intervals = time.perf_counter() - start
    start = time.perf_counter()
    fit_terms(curve)
    terms = time.perf_counter() - start
    off = np.abs(curve.deviation / np.array(peers) - 1.0).max()
    print(
        f"{options.channels} records of {n} samples, {curve.m.size} averaging times; largest relative difference {off:.1e}"
    )
    print(
        f"values and intervals {1e3 * ours:7.1f} ms; allantools: values {1e3 * values:.1f} ms, with intervals "
        f"{1e3 * (values + intervals):.1f} ms; ratio {(values + intervals) / ours:.1f}"
    )
    print(f"Q, N, B, K, R with intervals {1e3 * terms:.1f} ms, {1e3 * terms / options.channels:.1f} ms a channel")


if __name__ == "__main__":
    main()
