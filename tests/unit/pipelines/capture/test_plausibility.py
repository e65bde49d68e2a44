"""The capture's check of the table goes by the same summaries as validation, and ends a run whose units all disagree."""

from functools import partial
from itertools import starmap

import numpy as np
import pandas as pd
import pytest

from inertial.pointing import force_from_angles
from pipelines.capture.record import TURNED, Plausibility
from pipelines.tables.summaries import MEANS, first_outlier, summarised, unit_means
from schemas.errors import OperatorNeeded

ANGLES = [(outer, inner) for inner in (0.0, 40.0, -70.0) for outer in (-150.0, -90.0, -30.0, 30.0, 90.0, 150.0)]
UNITS = ("A", "B", "C")


def tables(angles: tuple[float, float], turned_deg: float = 0.0, record: int = 0) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and readings of a dwell at ``angles``, with the table ``turned_deg`` away from its outer encoder."""
    outer, inner = np.radians([angles[0] + turned_deg]), np.radians([angles[1]])
    force = force_from_angles(outer, inner)[0]
    rows = [
        {"unit": unit, "record": record, "kind": "calibration", "x": 1e5 * x, "y": 1e5 * y, "z": 1e5 * z}
        for unit in UNITS
        for x, y, z in force + 1e-5 * np.random.default_rng(record).standard_normal((50, 3))
    ]
    shared = {"record": record, "status": "ok", "full_scale": 1e6, "outer_deg": angles[0], "inner_deg": angles[1]}
    return pd.DataFrame(rows), pd.DataFrame({"unit": UNITS, **shared})


def test_dwells_that_agree_with_the_encoders_pass():
    checks = Plausibility(reader=None, identities={})
    samples, readings = tables(ANGLES[0])
    checks.refuse_contradiction(0, samples.iloc[:0], readings)  # stored already: no dwell
    assert checks.pointing.means == []
    for record, angles in enumerate(ANGLES):
        checks.refuse_contradiction(0, *tables(angles, record=record))
    assert len(checks.pointing.means) == len(ANGLES)


def test_a_table_whose_zero_jumps_during_a_soak_ends_the_run():
    checks = Plausibility(reader=None, identities={})
    dwells = [tables(angles, 5.0 if record >= 9 else 0.0, record) for record, angles in enumerate(ANGLES)]
    for dwell in dwells[:9]:
        checks.refuse_contradiction(0, *dwell)
    with pytest.raises(OperatorNeeded, match=TURNED):
        list(starmap(partial(checks.refuse_contradiction, 0), dwells[9:]))


def test_the_first_sample_that_cannot_be_the_unit_s_is_told_with_the_median():
    output = np.random.default_rng(4).standard_normal((200, 3))
    assert first_outlier(output, 1.0, 1000.0) is None
    output[[70, 120], 1] = 40.0
    outlier = first_outlier(output, 1.0, 1000.0)
    assert (outlier.row, outlier.axis, outlier.value) == (70, 1, 40.0)
    assert abs(outlier.median) < 0.5
    assert first_outlier(output[:19], 1.0, 1000.0) is None  # too few to say
    output[3, 2] = np.nan
    assert first_outlier(output, 1.0, 1000.0) is not None  # nothing can be said to lie inside


@pytest.mark.parametrize("wild", [None, np.nan, np.inf])
def test_the_means_of_the_check_of_the_table_are_those_of_validation(wild: float | None) -> None:
    samples, readings = tables(ANGLES[3], record=4)
    if wild is not None:
        samples.loc[60, "y"] = wild
    whole = summarised([samples], readings).set_index("unit")
    means = unit_means(samples)
    assert list(means) == list(UNITS)
    for unit, mean in means.items():
        np.testing.assert_array_equal(mean, whole.loc[unit, list(MEANS)].to_numpy(dtype=float))
