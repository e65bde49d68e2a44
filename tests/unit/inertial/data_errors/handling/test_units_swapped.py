"""No pair of units is searched where none was exchanged."""

import numpy as np
import pytest
from made_worlds import HIDDEN, NULLS, World, lot_in, make

from inertial.data_errors.handling.units_swapped import UnitsSwapped


@pytest.mark.parametrize(
    "world", [*(NULLS[n] for n in ("B30", "K8", "two_units", "many_units")), HIDDEN["third_order_2"]]
)
def test_no_pair_is_searched_where_no_units_were_exchanged(world: World) -> None:
    lots = (make(world, 6_300_020 + seed) for seed in range(4))
    assert [UnitsSwapped().places(lot_in(one)) for one in lots] == [[]] * 4
    assert not UnitsSwapped().possible(np.array([0.5]))
