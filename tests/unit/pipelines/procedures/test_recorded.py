"""The units before a procedure: what of their output is at the end of the range."""

import numpy as np

from pipelines.procedures.recorded import Device


def test_the_end_of_the_range_is_seen_where_the_converter_rounds_it() -> None:
    """An analogue output of 0.35 V reads 0.34999999 V behind 24 bits, and 7 mV/g make it 49.999998 g."""
    device = Device({}, {}, 0.35, "V")
    assert device.at_end(np.array([0.0, 0.34999999, -0.34999999, 0.349])) == 2
