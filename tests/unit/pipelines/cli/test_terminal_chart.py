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


def test_points_are_marks_beside_a_line_and_the_axis_is_labelled_as_told() -> None:
    lines = [Line("", "", [(-1.0, 0.0), (0.0, 1.0), (1.0, 0.0)], mark="•"), Line("", "", [(-1.0, -1.0), (1.0, -1.0)])]
    drawn = chart(
        "", lines, 60, 7, (-1.0, 1.0), bounds=(-1.0, 1.0), label=lambda value: f"{value:.2f}"
    ).plain.splitlines()
    assert sum(row.count("•") for row in drawn) == 3
    assert drawn[1].count("•") == 1  # at the upper bound
    assert set(drawn[7].partition("│")[2].strip()) == {"⣀"}
    assert drawn[8].split() == ["-1.00", "0.00", "1.00"]
