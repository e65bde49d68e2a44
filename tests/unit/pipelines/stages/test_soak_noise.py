"""White noise of each soak and its change with temperature, from the samples of a simulated thermal run."""

import numpy as np
import pandas as pd
import pytest

from pipelines.stages.soak_noise import DIFFERS, FALLS, GROWS, NOT_JUDGED, NOT_TOLD, SAME, soak_noise, verdict
from pipelines.tables.calibration import column_names

LEVELS = (-40.0, 0.0, 40.0, 80.0)
DENSITY = 20.0  # µg/√Hz, two-sided, at 25 °C
RATE, N = 100.0, 400


def run_of(
    per_K: float,
    seed: int,
    units: int = 2,
    dwells: int = 6,
    levels: tuple[float, ...] = LEVELS,
    louder: dict[str, tuple[float, float, float]] | None = None,
) -> tuple[list[pd.DataFrame], pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Samples, readings, coefficients and their covariance of units whose white noise grows by a share per kelvin.

    louder : factors of the axes of some units in the last soak
    """
    rng, scale = np.random.default_rng(seed), 2.0
    samples, readings = [], []
    for soak, level in enumerate(levels):
        sigma = 1e-6 * DENSITY * np.sqrt(RATE) * np.exp(per_K * (level - 25.0)) * scale
        for record in range(soak * dwells, (soak + 1) * dwells):
            parts = []
            for u in range(units):
                known = {"unit": f"U{u}", "record": record, "kind": "dwell"}
                own = sigma * np.array((louder or {}).get(f"U{u}", (1.0, 1.0, 1.0)) if level == levels[-1] else 1.0)
                output = rng.uniform(-1.0, 1.0, 3) + own * rng.standard_normal((N, 3))
                parts.append(pd.DataFrame(output, columns=["x", "y", "z"]).assign(**known))
                of_record = {"status": "ok", "soak": soak, "unit_C": level + 0.1 * u, "rate_hz": RATE, "n": N}
                readings.append(known | of_record)
            samples.append(pd.concat(parts))
    axes = [(f"U{u}", axis, k) for u in range(units) for k, axis in enumerate("xyz")]
    values = {"bias": 0.0, "scale": scale}
    coefficients = pd.DataFrame(
        [(u, axis, *name, values[name[0]], 0.0) for u, axis, k in axes for name in column_names(tuple(values))[k]],
        columns=["unit", "axis", "effect", "name", "value", "standard_error"],
    )
    covariance = pd.DataFrame(
        [(u, axis, i, j, 0.0) for u, axis, _ in axes for i in range(2) for j in range(i + 1)],
        columns=["unit", "axis", "row", "column", "value"],
    )
    return samples, pd.DataFrame(readings), coefficients, covariance


def test_noise_that_grows_is_told_with_its_ratio_on_every_axis() -> None:
    tables = soak_noise(*run_of(0.006, seed=3))
    change, soaks = tables["noise_temperature"], tables["soak_noise"]
    true = np.exp(0.006 * 120.0)
    assert change["verdict"].tolist() == [GROWS] * 6
    assert np.all((change["low"] < true + 0.15) & (true - 0.15 < change["high"]))
    assert change["ratio"].mean() == pytest.approx(true, rel=0.05)
    assert change["p_value"].max() < 1e-6
    at = soaks[soaks["soak"] == 1]
    assert at["value"].mean() == pytest.approx(DENSITY * np.exp(-0.006 * 25.0), rel=0.05)
    assert np.all(np.abs(soaks["curve"] / (DENSITY * np.exp(0.006 * (soaks["temperature_C"] - 25.0))) - 1.0) < 0.15)


@pytest.mark.slow
def test_noise_that_stays_is_told_to_stay() -> None:
    named = [soak_noise(*run_of(0.0, seed=seed))["noise_temperature"]["verdict"] for seed in range(20, 24)]
    assert pd.concat(named).unique().tolist() == [SAME]


def test_soaks_at_one_temperature_and_units_without_coefficients_have_no_rows() -> None:
    samples, readings, coefficients, covariance = run_of(0.006, seed=4, units=1)
    near = readings.assign(unit_C=25.0 + 0.5 * readings["soak"])
    assert soak_noise(samples, near, coefficients, covariance)["noise_temperature"].empty
    assert soak_noise(samples, readings, coefficients.iloc[:0], covariance.iloc[:0])["soak_noise"].empty


ENDS = (-40.0, 80.0)


@pytest.mark.parametrize(
    ("units", "louder"),
    [(1, {"U0": (1.5, 1.5, 1.5)}), (4, {"U3": (2.0, 2.0, 2.0)}), (2, {"U0": (1.0, 1.0, 2.0), "U1": (1.0, 1.0, 2.0)})],
)
def test_an_axis_is_judged_by_its_own_ratio(units: int, louder: dict[str, tuple[float, float, float]]) -> None:
    change = soak_noise(*run_of(0.0, 7, units, levels=ENDS, louder=louder))["noise_temperature"]
    for unit, own in change.groupby("unit"):
        for factor, told in zip(
            louder.get(str(unit), (1.0, 1.0, 1.0)), own.sort_values("axis")["verdict"], strict=True
        ):
            assert told == (GROWS if factor > 1.0 else SAME)


def test_a_change_is_told_by_the_axis_or_by_the_lot_and_no_change_where_it_is_known() -> None:
    assert verdict(1.5, 0.1, 1e-9, 24) == verdict(1.5, 0.1, 0.5, 24) == verdict(1.5, 0.1, float("nan"), 1) == GROWS
    assert verdict(0.5, 0.1, 1e-9, 24) == verdict(0.5, 0.1, 0.5, 24) == FALLS
    assert verdict(1.05, 0.1, 1e-9, 24) == DIFFERS
    assert verdict(1.05, 0.1, 0.5, 24) == SAME
    assert verdict(1.2, 0.18, 0.5, 24) == verdict(1.05, 0.3, 0.5, 24) == NOT_TOLD
    assert verdict(1.05, 0.1, float("nan"), 1) == verdict(1.05, float("nan"), 0.5, 24) == NOT_JUDGED
