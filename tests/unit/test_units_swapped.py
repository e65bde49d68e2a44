"""No pair of units is searched where none was exchanged."""

import sys
from pathlib import Path

import numpy as np
import pytest

from inertial.data_errors.handling.units_swapped import UnitsSwapped
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks" / "worlds"))

from tables import HIDDEN, NULLS
from world import World, make

SEED = 6_300_000


@pytest.mark.parametrize(
    "world", [*(NULLS[n] for n in ("B30", "K8", "two_units", "many_units")), HIDDEN["third_order_2"]]
)
def test_no_pair_is_searched_where_no_units_were_exchanged(world: World) -> None:
    lots = (make(world, SEED + 20 + seed) for seed in range(5))
    assert [UnitsSwapped().places(lot_of(measured(one.dwells, one.history))) for one in lots] == [[]] * 5
    assert not UnitsSwapped().possible(np.array([0.5]))
