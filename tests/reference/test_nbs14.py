"""Published numbers of the NBS14 data sets: W. J. Riley, NIST Special Publication 1065 (2008), tables 30-32."""

import numpy as np
import pytest
from each import each

from inertial.noise.allan import overlapping
from inertial.noise.terms import fit_terms
from pipelines.stages.deviations import STATISTICS, deviations

NINE = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]


def thousand() -> list[float]:
    """The 1000-point set: n[i+1] = 16807 n[i] mod 2147483647 from 1234567890, divided by the modulus."""
    number, out = 1234567890, []
    for _ in range(1000):
        out.append(number / 2147483647)
        number = 16807 * number % 2147483647
    return out


def test_nine_and_thousand_points() -> None:
    data = np.array(thousand())
    assert data.mean() == pytest.approx(4.897745e-01, abs=1e-7)
    assert data.std(ddof=1) == pytest.approx(2.884664e-01, abs=1e-7)
    assert overlapping(NINE, 1.0, [1, 2]).deviation == pytest.approx([91.22945, 85.95287], abs=1e-5)
    curve = overlapping(thousand(), 1.0, [1, 10, 100])
    assert curve.deviation == pytest.approx([2.922319e-01, 9.159953e-02, 3.241343e-02], abs=1e-7)


TABLE_31 = {  # which is also what allantools is tested with
    "modified": [2.922319e-01, 6.172376e-02, 2.170921e-02],
    "time": [1.687202e-01, 3.563623e-01, 1.253382e00],
    "hadamard": [2.943883e-01, 9.581083e-02, 3.237638e-02],
    "total": [2.922319e-01, 9.134743e-02, 3.406530e-02],
}


@each(TABLE_31)
def test_thousand_points_by_other_statistics(statistic: str) -> None:
    records = np.array([thousand()])
    curve = overlapping(records, 1.0, [1, 2, 5, 10, 20, 50, 100])
    terms = fit_terms(curve)
    found = deviations(STATISTICS[statistic], records, "", curve, terms, explained=np.array([True]))
    assert found.deviation[0, [0, 3, 6]] == pytest.approx(TABLE_31[statistic], rel=4e-7)
    assert np.all((found.low < found.deviation) & (found.deviation < found.high))
