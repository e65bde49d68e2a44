"""Extended and unscented filter on [a, b] side by side: `python benchmarks/unscented.py --runs 200`.

Where the force is known, the output is linear in the bias, and both filters are the Kalman filter; the script prints by how
much they differ. At rest in an unknown pose only |a| = g is known, which is not linear: |f − b| = g. There the product's filter
(linear in the bias at b = 0, `known_magnitude`), an extended one (linear at the estimate) and an unscented one (2n + 1 points)
have the same outputs and the same gate: a unit that rests for a second in each of many poses, with the bias of a switch-on and
the noise of a preset. Truth is drawn from the noise model itself, so that nothing but the treatment of the nonlinearity
differs. NEES is the mean of (error / stated)² of the last tenth of the poses, 1 where the statement is right.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from inertial.noise.bias_filter import GATE_SIGMA, BiasFilter  # noqa: E402
from inertial.noise.gauss_markov import BiasModel, bias_model, flicker_of_steps, step_of_process  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402

Array = np.ndarray
STEP_S, POSES = 1.0, 600
SWITCH_ON_G = (1e-3, 1e-2, 1e-1, 3e-1)
ALPHA_KAPPA = 3.0  # n + κ of the unscented transformation for Gaussian states (Julier and Uhlmann)


class Extended(BiasFilter):
    """Linear at the estimate."""

    def known_magnitude(self, force: Array, magnitude: float, seconds: float) -> None:
        """|f − b| = magnitude, to first order in the error of the bias."""
        left = force - self.bias
        length = float(np.linalg.norm(left))
        row = (left / length) @ self._mean
        variance = float((left / length) ** 2 @ self.model.white**2) / seconds
        self._update(row, length - magnitude + float(row @ self._x), variance, 3)


class Unscented(BiasFilter):
    """Sigma points of the bias through |f − b|; what the other parts of the state know of the bias goes with the gain."""

    def known_magnitude(self, force: Array, magnitude: float, seconds: float) -> None:
        """|f − b| = magnitude, mean and variance from seven points."""
        covariance, bias = self.covariance, self.bias
        root = np.linalg.cholesky(ALPHA_KAPPA * covariance)
        points = np.vstack([bias, bias + root.T, bias - root.T])
        weight = np.full(7, 0.5 / ALPHA_KAPPA)
        weight[0] = 1.0 - 3.0 / ALPHA_KAPPA
        lengths = np.linalg.norm(force - points, axis=1)
        mean = float(weight @ lengths)
        along = (force - bias) / np.linalg.norm(force - bias)
        total = float(weight @ (lengths - mean) ** 2) + float(along**2 @ self.model.white**2) / seconds
        across = (weight * (lengths - mean)) @ (points - bias)  # of bias and length
        gain = self._p @ self._mean.T @ np.linalg.solve(covariance, across) / total
        innovation = magnitude - mean
        if abs(innovation) > GATE_SIGMA * np.sqrt(total):
            self.rejected += 1
            return
        self.innovations.append((3, innovation / np.sqrt(total)))
        self._x = self._x + gain * innovation
        self._p = self._p - total * np.outer(gain, gain)


FILTERS = {"product": BiasFilter, "extended": Extended, "unscented": Unscented}


def model_of(preset: Preset, switch_on: float) -> BiasModel:
    """The noise of a preset and the bias of a switch-on, of three axes."""
    one = np.ones(3)
    return bias_model(
        1e-6 * preset.noise_density_ug / np.sqrt(2.0) * one,
        1e-6 * preset.bias_instability_ug * one,
        0.0 * one,
        switch_on * one,
        flicker_of_steps(STEP_S, STEP_S * POSES),
    )


def drawn(model: BiasModel, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Bias, force and output (n, 3), g, of a unit that rests in random poses."""
    constant = model.turn_on * rng.standard_normal(3)
    bias = np.tile(constant, (POSES, 1))
    for k, correlation in enumerate(model.correlation_s):
        keep = step_of_process(1.0, float(correlation), STEP_S).keep
        path = np.zeros((POSES, 3))
        path[0] = rng.standard_normal(3)
        for n in range(1, POSES):
            path[n] = keep * path[n - 1] + np.sqrt(1.0 - keep**2) * rng.standard_normal(3)
        bias = bias + path * model.sd[:, k]
    direction = rng.standard_normal((POSES, 3))
    force = direction / np.linalg.norm(direction, axis=1)[:, None]
    return bias, force, force + bias + model.white / np.sqrt(STEP_S) * rng.standard_normal((POSES, 3))


def followed(kind: str, model: BiasModel, output: Array) -> tuple[Array, Array, float]:
    """Bias and stated standard deviation (n, 3), g, and the time of a step, µs."""
    one, bias, stated = FILTERS[kind](model), np.empty((POSES, 3)), np.empty((POSES, 3))
    start = time.process_time()
    for n in range(POSES):
        one.predict(STEP_S)
        one.known_magnitude(output[n], 1.0, STEP_S)
        bias[n], stated[n] = one.bias, np.sqrt(np.diagonal(one.covariance))
    return bias, stated, 1e6 * (time.process_time() - start) / POSES


def linear_difference(model: BiasModel, rng: np.random.Generator) -> float:
    """Largest difference of the sigma-point update and the Kalman update of a known force, over the stated error."""
    worst = 0.0
    for _ in range(20):
        p = model.turn_on[0] ** 2 * np.eye(3) + 1e-12
        x, z, r = np.zeros(3), model.turn_on[0] * rng.standard_normal(), model.white[0] ** 2
        row = rng.standard_normal(3)
        root = np.linalg.cholesky(ALPHA_KAPPA * p)
        points = np.vstack([x, x + root.T, x - root.T])
        weight = np.array([1.0 - 3.0 / ALPHA_KAPPA, *np.full(6, 0.5 / ALPHA_KAPPA)])
        seen = points @ row
        total = float(weight @ (seen - weight @ seen) ** 2) + r
        unscented = (weight * (seen - weight @ seen)) @ (points - x) / total * z
        kalman = p @ row / (row @ p @ row + r) * z
        worst = max(worst, float(np.max(np.abs(unscented - kalman)) / np.sqrt(p[0, 0])))
    return worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--preset", default="adxl355")
    options = parser.parse_args()
    preset = load_preset(options.preset)
    rng = np.random.default_rng(options.seed)
    print(f"known force: unscented and Kalman update differ by {linear_difference(model_of(preset, 1e-2), rng):.1e} sd")
    print(f"magnitude, {options.preset}, {POSES} poses: error of the bias (rms) and NEES of the last tenth, µs a step")
    heads = (
        [f"{kind}, µg" for kind in FILTERS] + [f"NEES {kind}" for kind in FILTERS] + [f"µs {kind}" for kind in FILTERS]
    )
    print(("{:>10}" + " {:>14}" * len(heads)).format("switch-on", *heads))
    for switch_on in SWITCH_ON_G:
        model = model_of(preset, switch_on)
        errors, pulls, spent = ({kind: list[Array]() for kind in FILTERS} for _ in range(3))
        for _ in range(options.runs):
            bias, _, output = drawn(model, rng)
            for kind in FILTERS:
                found, stated, micros = followed(kind, model, output)
                last = slice(-POSES // 10, None)
                errors[kind].append(found[last] - bias[last])
                pulls[kind].append((found[last] - bias[last]) / stated[last])
                spent[kind].append(np.array([micros]))
        rms = [f"{1e6 * np.sqrt(np.mean(np.concatenate(errors[kind]) ** 2)):.1f}" for kind in FILTERS]
        nees = [f"{np.mean(np.concatenate(pulls[kind]) ** 2):.2f}" for kind in FILTERS]
        cost = [f"{np.median(np.concatenate(spent[kind])):.0f}" for kind in FILTERS]
        print(("{:>10}" + " {:>14}" * len(heads)).format(f"{1e3 * switch_on:g} mg", *rms, *nees, *cost), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
