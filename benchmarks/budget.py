"""Whether stated uncertainties cover: `python benchmarks/budget.py --units 304`.

Lots are measured on a station that draws every stated contribution at random for each lot (gravity, level, axes, encoders,
poses, seat, thermometer, gradient, gain, reader), with devices and flicker of a preset, and go through the chain's own fit,
verify and budget. Reported are the shares of coefficients, and of corrected outputs at random forces and temperatures, whose
error lies within the stated 95 % interval, and wrong acceptances against the probability of false acceptance that was stated;
below each row, for every certified coefficient, the share within its expanded uncertainty U = k·u as a certificate states it
(95.45 %), with a 95 % interval by lots, as units of a lot share the errors of their station.
The station is the simulated plant's own geometry; it does not know the budget.
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
import pandas as pd  # noqa: E402

from benchmarks.budget_lots import BASE, DWELL_S, LOT, RECIPES, Plan, measured, plan_of, true_coefficients  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from pipelines.stages.fit import fit  # noqa: E402
from pipelines.stages.uncertainty.budget import budget  # noqa: E402
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms  # noqa: E402
from pipelines.stages.verify import verify  # noqa: E402
from schemas.decisions import outside  # noqa: E402
from schemas.uncertainty import Uncertainty  # noqa: E402
from schemas.validity import CertificateTerms, Stability  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402

Array = np.ndarray
PRESETS = ("adxl355", "sf1500", "qa700", "analogue")
STATED = Uncertainty.model_validate(
    {
        "grade_source": "certificates",
        "gravity": {"value_m_s2": 9.80665, "standard_gravity_meant": True, "u_ppm": 10.0, "reference": "G"},
        "level": {"u_urad": 100.0, "reference": "L"},
        "orthogonality": {"u_urad": 60.0, "reference": "A"},
        "outer_offset": {"u_urad": 60.0, "reference": "A"},
        "inner_offset": {"u_urad": 100.0, "reference": "A"},
        "harmonics": {"u_urad": 40.0, "reference": "A"},
        "pose": {"u_urad": 50.0},
        "seat": {"u_urad": 500.0, "scope": "mount", "source": "remounts"},
        "thermometer": {
            "measures": "slot",
            "offset_u_K": 0.3,
            "slope_u_percent": 0.3,
            "soak_u_K": 0.1,
            "reference": "T",
        },
        "gradient": {"u_K": 0.2, "scope": "slot", "source": "sensors"},
        "reader": {"gain_u_ppm": 30.0, "offset_u_ug": 5.0, "source": "voltmeter"},
    }
)


def columns(force: Array, theta: Array, axis: int, width: int) -> Array:
    parts = [np.ones(len(force)), force[:, axis], force[:, (axis + 1) % 3], force[:, (axis + 2) % 3]]
    parts += [theta, theta**2, theta * force[:, axis], theta**2 * force[:, axis]]
    return np.stack(parts[:width], axis=1)


def one_lot(plan: Plan, preset: Preset, rng: np.random.Generator) -> dict[str, list]:
    """What is inside its interval: coefficients, corrected outputs; errors of verification as stated and as a user meets them."""
    dwells, truths, noise = measured(plan, preset, rng)
    history = pd.DataFrame({"time_s": [0.0], "chamber_C": [25.0], "slot": [0], "unit": ["U0"], "unit_C": [25.0]}).iloc[
        :0
    ]
    fitted = fit(dwells, history, plan.effects)
    checked = verify(dwells, history, fitted["coefficients"], fitted["covariance"], fitted["predictions"])
    stability = Stability(horizon_days=3660.0, source="history", bias_temperature_ug_K=preset.bias_tempco_ug_per_K,
                          scale_temperature_ppm_K=preset.scale_tempco_ppm_per_K, temperature_of="slot")  # fmt: skip
    terms = BudgetTerms(STATED, stability, CertificateTerms(frame="fixture"), (), 900.0, DWELL_S, 23.0)
    empty = pd.DataFrame({"unit": [], "axis": [], "term": [], "value": [], "high": [], "identified": []})
    tables = BudgetTables(dwells, history, fitted["coefficients"], fitted["covariance"], fitted["wander"],
                          checked["verification"], checked["verification_poses"], empty)  # fmt: skip
    stated = budget(tables, terms)
    width = 4 if plan.effects == BASE else 8
    out: dict[str, list] = {"coefficients": [], "noise only": [], "outputs": [], "shown": [], "u": [], "met": []}
    sums = stated["uncertainties"]
    for unit, truth in enumerate(truths):
        own = f"U{unit}"
        names = fitted["coefficients"]["unit"] == own
        estimate = (
            fitted["coefficients"]
            .loc[names & (fitted["coefficients"]["axis"] != "*"), "value"]
            .to_numpy()
            .reshape(3, width)
        )
        for name, inside in _certified(
            sums[sums["unit"] == own], estimate, true_coefficients(truth, plan.effects)
        ).items():
            out.setdefault(f"U of {name}", []).extend(inside)
        by_noise = _triangle(
            fitted["covariance"][fitted["covariance"]["unit"] == own]["value"].to_numpy().reshape(3, -1), width
        )
        by_budget = _triangle(stated["budget_covariance"].query("unit == @own")["value"].to_numpy()[None], 3 * width)[0]
        error = estimate - true_coefficients(truth, plan.effects)
        whole = by_budget.copy()
        for a in range(3):
            whole[a * width : (a + 1) * width, a * width : (a + 1) * width] += by_noise[a]
        wanted = [0, 1, 2, 3, *((4, 6) if width == 8 else ())]
        u = np.sqrt(np.diagonal(whole)).reshape(3, width)
        out["coefficients"] += (np.abs(error) <= 1.959964 * u)[:, wanted].ravel().tolist()
        alone = np.sqrt(np.diagonal(by_noise, axis1=1, axis2=2))
        out["noise only"] += (np.abs(error) <= 1.959964 * alone)[:, wanted].ravel().tolist()
        out["outputs"] += _outputs(estimate, error, whole, width, plan, rng)
        _verified(out, plan, noise[unit], estimate, error, sums[sums["unit"] == own], width)
    return out


PLACES = {"bias": (0,), "scale": (1,), "misalignment": (2, 3), "bias_temperature": (4,), "scale_temperature": (6,)}
"""Columns of the certified coefficients of an axis."""


def _certified(stated: pd.DataFrame, estimate: Array, true: Array) -> dict[str, list[bool]]:
    """Whether the error of each certified coefficient of a unit is within the U that is stated for it."""
    relative = 1e6 * (estimate - true) / estimate[:, [1]]
    inside: dict[str, list[bool]] = {}
    for name, places in PLACES.items():
        for axis, letter in enumerate("xyz"):
            own = stated[(stated["quantity"] == name) & (stated["axis"].str[0] == letter)]
            errors = [relative[axis, place] for place in places[: len(own)]]
            inside.setdefault(name, []).extend(np.abs(errors) <= own["expanded"].to_numpy())
    angles = stated[stated["quantity"] == "orthogonality"].set_index("axis")["expanded"]
    pairs = {"xy": (0, 2, 1, 3), "yz": (1, 2, 2, 3), "zx": (2, 2, 0, 3)}
    inside["orthogonality"] = [abs(relative[i, a] + relative[j, b]) <= angles[k] for k, (i, a, j, b) in pairs.items()]
    return {name: values for name, values in inside.items() if values}


def _covered(inside: Array) -> str:
    """Share of ``inside`` (lots, values of a lot) with a 95 % interval by the scatter of the lots."""
    of_lots = np.asarray(inside, dtype=float).reshape(len(inside), -1).mean(axis=1)
    share, half = of_lots.mean(), 1.96 * of_lots.std(ddof=1) / np.sqrt(len(of_lots)) if len(of_lots) > 1 else np.nan
    return f"{share:.3f} [{share - half:.3f}, {min(share + half, 1.0):.3f}]"


def _triangle(values: Array, size: int) -> Array:
    out = np.zeros((len(values), size, size))
    row, column = np.tril_indices(size)
    out[:, row, column] = values
    out[:, column, row] = values
    return out


def response_of(estimate: Array) -> Array:
    k = np.zeros((3, 3))
    for a in range(3):
        k[a, a], k[a, (a + 1) % 3], k[a, (a + 2) % 3] = estimate[a, 1:4]
    return k


def _outputs(
    estimate: Array, error: Array, whole: Array, width: int, plan: Plan, rng: np.random.Generator
) -> list[bool]:
    """Whether corrected outputs at random forces and temperatures of the range lie within their intervals."""
    force = rng.standard_normal((5, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    theta = rng.uniform(min(plan.levels), max(plan.levels), 5) - 25.0
    inverse = np.linalg.inv(response_of(estimate))
    inside: list[bool] = []
    for f, t in zip(force, theta, strict=True):
        h = np.zeros((3, 3 * width))
        for a in range(3):
            h[a, a * width : (a + 1) * width] = columns(f[None], np.array([t]), a, width)[0]
        off, spread = -inverse @ h @ error.ravel(), np.sqrt(np.diagonal(inverse @ h @ whole @ h.T @ inverse.T))
        inside += (np.abs(off) <= 1.959964 * spread).tolist()
    return inside


def _verified(
    out: dict[str, list], plan: Plan, noise: Array, estimate: Array, error: Array, sums: pd.DataFrame, width: int
) -> None:
    """RMS error of verification as it was shown with its u, and as a user of the true force and temperature meets it, µg."""
    force = force_from_angles(plan.outer, plan.inner)[plan.check]
    theta = np.array(plan.levels)[plan.soak][plan.check] - 25.0
    inverse = np.linalg.inv(response_of(estimate))
    moved = np.stack([columns(force, theta, a, width) @ error[a] for a in range(3)], axis=1)
    met = (noise[plan.check] - moved) @ inverse.T
    for a, letter in enumerate("xyz"):
        row = sums[(sums["quantity"] == "bias_error") & (sums["axis"] == letter)].iloc[0]
        out["shown"].append(float(row["value"]))
        out["u"].append(float(row["u"]))
        out["met"].append(float(1e6 * np.sqrt(np.mean(met[:, a] ** 2))))


def decisions(shown: Array, u: Array, met: Array, limit: float, guard: float) -> tuple[int, int, float]:
    """Accepted with a guard band of ``guard``·u, of them wrong, and wrong ones that the stated probabilities expect."""
    accepted = shown + guard * u <= limit
    wrong = int(np.sum(accepted & (met > limit)))
    expected = sum(outside(s, v, limit) for s, v in zip(shown[accepted], u[accepted], strict=True))
    return int(accepted.sum()), wrong, expected


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=304)
    parser.add_argument("--seed", type=int, default=20261)
    parser.add_argument("--recipe", action="append", choices=list(RECIPES))
    parser.add_argument("--preset", action="append", choices=PRESETS)
    options = parser.parse_args()
    print(
        "share of errors within the stated 95 % interval, %; wrong acceptances of accepted figures (stated probabilities)"
    )
    print("simple: limit at the median of error + u; guarded: error + 2u, limit at its median")
    heads = ("recipe", "device", "units", "coefficients", "outputs", "noise only", "simple", "guarded, w = U", "s")
    print("{:18} {:8} {:>5} {:>12} {:>8} {:>10} {:>22} {:>22} {:>5}".format(*heads))
    for recipe in options.recipe or RECIPES:
        for name in options.preset or PRESETS:
            start, plan, preset = time.perf_counter(), plan_of(recipe), load_preset(name)
            rng = np.random.default_rng([options.seed, list(RECIPES).index(recipe), PRESETS.index(name)])
            whole: dict[str, list] = {}
            lots = -(-options.units // LOT)
            for _ in range(lots):
                for key, values in one_lot(plan, preset, rng).items():
                    whole.setdefault(key, []).extend(values)
            shown, u, met = (np.array(whole[key]) for key in ("shown", "u", "met"))
            shares = [f"{100 * np.mean(whole[key]):.1f}" for key in ("coefficients", "outputs", "noise only")]
            cells = []
            for guard, reach in ((0.0, 1.0), (2.0, 2.0)):
                accepted, wrong, expected = decisions(shown, u, met, float(np.median(shown + reach * u)), guard)
                cells.append(f"{wrong} of {accepted} ({expected:.1f})")
            row = (recipe, name, lots * LOT, *shares, *cells, round(time.perf_counter() - start))
            print("{:18} {:8} {:5} {:>12} {:>8} {:>10} {:>22} {:>22} {:5}".format(*row), flush=True)
            for key in (key for key in whole if key.startswith("U of ")):
                print(f"    {key:22} {_covered(np.reshape(whole[key], (lots, -1)))}, n = {len(whole[key])}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
