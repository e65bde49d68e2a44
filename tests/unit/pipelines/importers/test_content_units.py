"""Units that the name of a column states."""

import pytest

from pipelines.importers.content import unit_in


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("out [g]", "g"),
        ("time (ms)", "ms"),
        ("time_s", "s"),
        ("out_g", "g"),
        ("acc_mV", "mV"),
        ("ref_m_s2", "m/s^2"),
        ("axes", ""),
        ("log", ""),
        ("_sg", ""),
        ("out_G", ""),
    ],
)
def test_a_unit_stands_in_brackets_or_behind_an_underscore(name: str, unit: str) -> None:
    assert unit_in(name) == unit
