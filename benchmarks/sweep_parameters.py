"""``python -m benchmarks.sweep_parameters N SEED``: what sweeps state of sensors with an unknown low-pass behind them.

Sprung masses of 0.7 to 4 kHz, lightly and heavily damped, alone or behind one pole, two poles or a moving average near their
natural frequency, with a delay; stepped sines to 1, 2, 5 or 10 kHz. The truth is computed by scipy's filters and by a sinc.
Prints how many natural frequencies are stated, how many of them lie beyond twice their standard uncertainty, and how many are
stated although the sweep ends below them.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import signal, stats

from inertial.dynamics.transfer_diagnosis import diagnose_transfer
from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_model import Points
from pipelines.procedures.transfer_figures import figures_of_transfer

PART: Any = SimpleNamespace(axis="z", flat_to_hz=None, nominal_scale=1.0, reference_percent=0.25)
FILTERS = ("none", "one_pole", "two_pole", "moving_average")


def sweep(seed: int, k: int) -> tuple[Points, float, float]:
    """Points of a sweep, the natural frequency of its sensor, and the highest frequency that its filter needs."""
    rng = np.random.default_rng([seed, k])
    natural, damping, top = rng.uniform(700.0, 4000.0), rng.uniform(0.05, 0.9), rng.choice([1e3, 2e3, 5e3, 1e4])
    kind, corner = FILTERS[k % len(FILTERS)], natural * rng.uniform(0.4, 1.6)
    f = 5.0 * 2.0 ** np.arange(0.0, np.log2(top / 5.0) + 1e-9, 1.0 / 6.0)
    w, w0 = 2.0 * np.pi * f, 2.0 * np.pi * natural
    h = signal.freqs([w0**2], [1.0, 2.0 * damping * w0, w0**2], w)[1]
    if kind in {"one_pole", "two_pole"}:
        h = h * signal.freqs(*signal.butter(1 + (kind == "two_pole"), 2.0 * np.pi * corner, analog=True), w)[1]
    elif kind == "moving_average":
        turn = f * 0.443 / corner
        h = h * np.sinc(turn) * np.exp(-1j * np.pi * turn)
    h = h * np.exp(-1j * w * rng.uniform(0.0, 60e-6))
    error, n = 10.0 ** rng.uniform(-3.0, -2.3), f.size
    value = h * np.exp(error * (rng.normal(size=n) + 1j * rng.normal(size=n)))
    points = Points(
        Conditions(f, np.ones(n), np.full(n, 25.0), np.ones(n)), value, np.full(n, error), np.full(n, error)
    )
    return points, natural, natural if kind == "none" else max(natural, corner)


def judged(seed: int, k: int) -> dict[str, bool]:
    """What is said of one sweep."""
    points, natural, reach = sweep(seed, k)
    top = float(points.conditions.frequency.max())
    figures = figures_of_transfer(PART, diagnose_transfer(points, highest_hz=max(top, 1e4)), points, None)
    figure = next(one for one in figures if one.figure == "sweep_natural_hz")
    outcome: dict[str, bool] = {}
    if figure.identified:
        outcome["stated within U"] = bool(abs(figure.value - natural) <= 2.0 * figure.uncertainty)
    if top < natural:
        outcome["beyond the band: not determined"] = not figure.identified
    if top > 2.0 * reach:
        outcome["well within the band: stated within U"] = outcome.get("stated within U", False)
    return outcome


def main() -> None:
    """Print the figures."""
    count, seed = int(sys.argv[1]), int(sys.argv[2])
    rows = [judged(seed, k) for k in range(count)]
    for name in dict.fromkeys(key for row in rows for key in row):
        hits = [row[name] for row in rows if name in row]
        limits = stats.binomtest(sum(hits), len(hits)).proportion_ci(0.95, "exact")
        print(f"{name}: {sum(hits)} of {len(hits)} [{100.0 * limits.low:.0f}, {100.0 * limits.high:.0f} %]")


if __name__ == "__main__":
    main()
