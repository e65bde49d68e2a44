"""Stated uncertainties cover: a short form of ``benchmarks/budget.py`` with every stated contribution drawn."""

import numpy as np

from benchmarks.budget import decisions, one_lot
from benchmarks.budget_lots import plan_of
from stations.plant.preset import load_preset


def test_intervals_cover_where_every_contribution_is_drawn_and_noise_alone_does_not() -> None:
    plan, preset, rng = plan_of("six faces"), load_preset("qa700"), np.random.default_rng(16)
    whole: dict[str, list] = {}
    for _ in range(4):
        for key, values in one_lot(plan, preset, rng).items():
            whole.setdefault(key, []).extend(values)
    # four draws of the station: what is common to a lot makes these shares scatter by some per cent
    assert np.mean(whole["coefficients"]) > 0.88
    assert np.mean(whole["outputs"]) > 0.85
    assert np.mean(whole["noise only"]) < 0.80
    shown, u, met = (np.array(whole[key]) for key in ("shown", "u", "met"))
    accepted, wrong, _ = decisions(shown, u, met, float(np.median(shown + 2.0 * u)), 2.0)
    assert accepted > 20
    assert wrong <= 2


def test_certified_bias_terms_of_quiet_devices_on_a_workshop_table_are_covered() -> None:
    plan, preset, rng = plan_of("24 directions × 3"), load_preset("qa700"), np.random.default_rng(4)
    lots = [one_lot(plan, preset, rng) for _ in range(5)]
    inside = np.concatenate([lot["coefficients"] for lot in lots]).reshape(-1, 3, 6)
    assert np.mean(inside[..., [0, 4]]) > 0.93
