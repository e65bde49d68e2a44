"""Whether stated uncertainties cover: `python benchmarks/budget.py --units 304`.

Lots are measured on a station that draws every stated contribution at random for each lot (gravity, level, axes, encoders,
poses, seat, thermometer, gradient, gain, reader), with devices and flicker of a preset, and go through the chain's own fit,
verify and budget. Reported are the shares of coefficients, and of corrected outputs at random forces and temperatures, whose
error lies within the stated 95 % interval, and wrong acceptances against the probability of false acceptance that was stated.
The station is the simulated plant's own geometry; it does not know the budget.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from inertial import poses  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from inertial.noise.dwells import DwellNoise, dwell_covariance  # noqa: E402
from pipelines.stages.budget import budget  # noqa: E402
from pipelines.stages.budget_terms import BudgetTables, BudgetTerms  # noqa: E402
from pipelines.stages.fit import fit  # noqa: E402
from pipelines.stages.verify import verify  # noqa: E402
from schemas.limits import outside  # noqa: E402
from schemas.station import ReferenceErrors  # noqa: E402
from schemas.uncertainty import Uncertainty  # noqa: E402
from schemas.validity import CertificateTerms, Stability  # noqa: E402
from stations.plant.device import Truth, draw_truth, rotation  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402
from stations.plant.reference_errors import StationErrors  # noqa: E402
from stations.plant.table import turn  # noqa: E402

Array = np.ndarray
VERIFICATION = np.array([[35.0, 15.0], [70.0, 140.0], [105.0, -100.0], [140.0, 60.0], [55.0, -35.0], [125.0, -160.0]])
BASE = ("bias", "scale", "misalignment")
WARM = ("bias_temperature", "bias_temperature_quadratic", "scale_temperature", "scale_temperature_quadratic")
RECIPES = {
    "six faces": ("six", (25.0,)),
    "twelve edges × 3": ("twelve", (0.0, 25.0, 50.0)),
    "24 directions × 3": ("fibonacci24", (-10.0, 25.0, 60.0)),
    "18 × 5": ("eighteen", (-30.0, 0.0, 25.0, 55.0, 85.0)),
}
PRESETS = ("adxl355", "sf1500", "qa700")
LOT = 8
DWELL_S, SPACING_S, SOAK_S, RATE_HZ = 10.0, 17.0, 1500.0, 100.0
SEAT, GRADIENT, SOAK_K, GAIN, OFFSET = 500e-6, 0.2, 0.1, 30e-6, 5e-6
DRAWN = ReferenceErrors(
    gravity_ppm=10.0, level_urad=100.0, orthogonality_urad=60.0, outer_offset_urad=60.0, inner_offset_urad=100.0,
    harmonics_urad=40.0, pose_urad=50.0, thermometer_offset_K=0.3, thermometer_slope_percent=0.3,
)  # fmt: skip
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


@dataclass(frozen=True)
class Plan:
    """Dwells of a recipe: angles in rad, soak, kind, time in s, pose."""

    outer: Array
    inner: Array
    soak: Array
    check: Array
    time: Array
    levels: tuple[float, ...]
    effects: tuple[str, ...]


def plan_of(recipe: str) -> Plan:
    name, levels = RECIPES[recipe]
    own = poses.plan(name)
    block = np.radians(np.concatenate([own, VERIFICATION, VERIFICATION, VERIFICATION]))
    count, soaks = len(block), len(levels)
    check = np.tile(np.arange(count) >= len(own), soaks)
    outer, inner = np.tile(block, (soaks, 1)).T
    soak = np.repeat(np.arange(soaks), count)
    return Plan(
        outer,
        inner,
        soak,
        check,
        SPACING_S * np.arange(outer.size) + SOAK_S * (soak + 1),
        levels,
        BASE + WARM * (soaks > 1),
    )


def measured(plan: Plan, preset: Preset, rng: np.random.Generator) -> tuple[pd.DataFrame, list[Truth], Array]:
    """Dwells of a lot on a station with errors of its own, the truth of its units, and the noise that they had, g."""
    station = StationErrors(DRAWN, rng)
    scatter = np.radians(station.pose_deg) * rng.standard_normal((2, plan.outer.size))
    outer, inner = station.table(plan.outer, plan.inner)
    up = station.up(np.array([0.0, 0.0, 1.0]))
    force = turn(up, outer + scatter[0], inner + scatter[1], station.orthogonality)
    of_soak = SOAK_K * rng.standard_normal(len(plan.levels))
    noise = DwellNoise(1e-6 * preset.noise_density_ug, 1e-6 * preset.bias_instability_ug, 0.0)
    root = np.linalg.cholesky(dwell_covariance(plan.time, DWELL_S, noise, since=float(plan.time.min()) - 5.0))
    frames, truths, drawn = [], [], []
    for unit in range(LOT):
        serial = f"U{unit}"
        seat = rotation(SEAT * rng.standard_normal(3))
        truth = draw_truth(
            preset, f"{rng.integers(2**31)}", 1, slot_rotation=np.eye(3), supply_ratio=1.0, output_scale=1.0
        )
        element = np.array(plan.levels)[plan.soak] + rng.normal(0.0, 0.3)
        read = station.reading(element - GRADIENT * rng.standard_normal()) + of_soak[plan.soak]
        theta = (element - 25.0)[:, None]
        out = (
            truth.bias_g
            + theta * truth.bias_tempco
            + (1.0 + 1e-6 * truth.scale_ppm)
            * (1.0 + theta * truth.scale_tempco)
            * (force @ seat.T @ truth.misalignment.T)
        )
        own = root @ rng.standard_normal((plan.outer.size, 3))
        out = out * (1.0 + GAIN * rng.standard_normal()) + OFFSET * rng.standard_normal(3) + own
        frames.append(_table(plan, serial, unit, read, out, noise.white(DWELL_S)))
        truths.append(truth)
        drawn.append(own)
    return pd.concat(frames, ignore_index=True), truths, np.stack(drawn)


def _table(plan: Plan, serial: str, slot: int, read: Array, out: Array, white: float) -> pd.DataFrame:
    n = int(DWELL_S * RATE_HZ)
    nominal = force_from_angles(plan.outer, plan.inner)
    names = [f"v{k % 6}" if c else f"p{k}" for k, c in enumerate(plan.check)]
    return pd.DataFrame(
        {
            "unit": serial, "slot": slot, "dwell": np.arange(plan.outer.size), "record": np.arange(plan.outer.size),
            "kind": np.where(plan.check, "verification", "dwell"), "pose": names, "soak": plan.soak, "time_s": plan.time,
            "duration_s": DWELL_S, "outer_deg": np.degrees(plan.outer), "inner_deg": np.degrees(plan.inner), "unit_C": read,
            "chamber_C": np.array(plan.levels)[plan.soak], "since_move_s": 7.0, "since_power_s": plan.time, "n": n,
            "out_unit": "g",
            **{f"force_{a}": nominal[:, k] for k, a in enumerate("xyz")}, **{f"out_{a}": out[:, k] for k, a in enumerate("xyz")},
            **{f"sd_{a}": max(white, 1e-9) * np.sqrt(n) for a in "xyz"},
        }
    )  # fmt: skip


def true_coefficients(truth: Truth, effects: tuple[str, ...]) -> Array:
    """(3, p) of a unit in its fixture, in the order of the model's columns."""
    scale = 1.0 + 1e-6 * truth.scale_ppm
    rows = []
    for a in range(3):
        row = [truth.bias_g[a], scale[a], *(scale[a] * truth.misalignment[a, (a + k) % 3] for k in (1, 2))]
        if len(effects) > len(BASE):
            row += [truth.bias_tempco[a], 0.0, scale[a] * truth.scale_tempco[a], 0.0]
        rows.append(row)
    return np.array(rows)


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


def _triangle(values: Array, size: int) -> Array:
    out = np.zeros((len(values), size, size))
    row, column = np.tril_indices(size)
    out[:, row, column] = values
    out[:, column, row] = values
    return out


def _response(estimate: Array) -> Array:
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
    inverse = np.linalg.inv(_response(estimate))
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
    inverse = np.linalg.inv(_response(estimate))
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
    return 0


if __name__ == "__main__":
    sys.exit(main())
