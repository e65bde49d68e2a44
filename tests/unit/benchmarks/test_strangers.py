"""The generator that knows nothing of the judge makes what it says."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.strangers import KINDS, make
from schemas import table_check


@pytest.fixture(scope="module")
def lots():
    return {name: make(name, seed=11, units=2) for name in KINDS}


def test_every_kind_makes_tables_of_the_exchange_format_of_the_size_asked_for(lots):
    for name, lot in lots.items():
        for dwells in (lot.dwells, lot.fresh):
            table_check.check("dwells", dwells, where=name)
            assert {"outer_deg", "inner_deg"} <= set(dwells) or {"force_x", "force_y", "force_z"} <= set(dwells)
        for history in (lot.history, lot.fresh_history):
            assert history is None or len(table_check.check("history", history, where=name))
        if lot.truth["scaled"]:
            assert lot.truth["size"] == pytest.approx(2.0, rel=0.3), name
        assert set(lot.truth["units"]) <= set(lot.dwells["unit"])
        assert set(lot.truth["dwells"]) <= set(lot.dwells["dwell"])


def test_another_day_measures_the_same_devices_with_other_noise(lots):
    assert all(set(lot.dwells["unit"]) == set(lot.fresh["unit"]) for lot in lots.values())
    clean = lots["null"]
    for serial, first in clean.dwells.groupby("unit"):
        fresh = clean.fresh[clean.fresh["unit"] == serial]
        assert not np.allclose(first["out_x"].head(10), fresh["out_x"].head(10), rtol=1e-12)
        coefficients = np.linalg.lstsq(_columns(fresh), fresh["out_x"], rcond=None)[0]
        left = np.std(first["out_x"] - _columns(first) @ coefficients) / first["out_x"].std()
        assert left < 10e-6 * clean.truth["noise_ug"]


def _columns(dwells: pd.DataFrame) -> np.ndarray:
    outer, inner = np.deg2rad(dwells["outer_deg"]), np.deg2rad(dwells["inner_deg"])
    force = np.stack([np.sin(inner) * np.sin(outer), np.cos(inner) * np.sin(outer), np.cos(outer)])
    theta = dwells["unit_C"].to_numpy() - 25.0
    return np.stack([np.ones(len(theta)), *force, theta, theta * force[0]], axis=1)


def test_a_seed_gives_the_same_lot_again(lots):
    for name in ("popcorn", "unit_loosens"):
        again = make(name, seed=11, units=2)
        pd.testing.assert_frame_equal(again.dwells, lots[name].dwells)
        assert again.truth == lots[name].truth
        assert not np.allclose(make(name, seed=12, units=2).dwells["out_x"].iloc[:20], again.dwells["out_x"].iloc[:20])
