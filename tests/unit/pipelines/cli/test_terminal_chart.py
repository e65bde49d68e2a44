"""Charts of the terminal: the labels of an axis differ, whatever the size of the values."""

import pytest

from pipelines.cli.chart import MARGIN, Line, chart


@pytest.mark.parametrize("size", [4e-6, 0.003, 0.2, 1.0, 30.0, 16384.0])
def test_labels_of_the_axis_differ_and_fit(size: float) -> None:
    drawn = chart("residual", [Line("x", "cyan", [(t, size * (-1.0) ** t) for t in range(6)])], 80, 7, (0.0, 5.0)).plain
    labels = [row[:MARGIN].strip() for row in drawn.splitlines()[1:8] if row[:MARGIN].strip()]
    assert len(labels) == len(set(labels)) == 4
    assert all(len(label) < MARGIN for label in labels)
    assert all(float(label) != 0.0 or not label.startswith("-") for label in labels)
