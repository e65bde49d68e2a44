"""Figures of a transfer function, and what is said of those that the points do not determine."""

import re

import numpy as np
from each import each

from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_effects.base import AMBIENT_C
from inertial.dynamics.transfer_model import Points
from pipelines.procedures.figures import FigureValue
from pipelines.procedures.transfer_figures import diagnosis_text, figures_of_model, judged_points


def figures(
    natural_hz: float, damping: float, top_hz: float, error: float = 3e-3
) -> tuple[dict[str, FigureValue], list[tuple[str, str]]]:
    """Figures and texts from 40 points of a second-order system, with errors of a share of the response."""
    rng, f = np.random.default_rng(1), np.geomspace(5.0, top_hz, 40)
    s, w = 2j * np.pi * f, 2.0 * np.pi * natural_hz
    response = w**2 / (s**2 + 2.0 * damping * w * s + w**2)
    value = response * np.exp(error * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)))
    conditions = Conditions(f, np.full(f.size, 1e-9), np.full(f.size, AMBIENT_C), np.full(f.size, np.nan))
    points = Points(conditions, value, np.full(f.size, error), np.full(f.size, error))
    found = judged_points(points, ("second_order",), 4.0 * top_hz)
    return {figure.figure: figure for figure in figures_of_model("x", found, points, "sweep")}, diagnosis_text(found)


@each([(2475.0, 0.02, 600.0), (2475.0, 0.7, 300.0), (5000.0, 0.7, 200.0), (900.0, 0.7, 2000.0)])
def test_an_interval_has_ends_that_are_measured_or_none(system: tuple[float, float, float]) -> None:
    natural_hz, damping, top_hz = system
    found, texts = figures(*system)
    for name, truth in (("sweep_natural_hz", natural_hz), ("sweep_damping", damping)):
        figure = found[name]
        assert not figure.low > truth
        assert not figure.high < truth
        assert not figure.high > 1e3 * truth
        assert not figure.low < 5e-4 * truth
        assert not re.search(r"e[+-]\d\d", " ".join(text for _, text in texts))
        known = figure.note.partition("points: ")[2].partition(";")[0]
        assert re.fullmatch(
            r"(no limit on either side|(at least|at most|95 % interval) [\d.… ]+(, with 95 %)?)?", known
        )
        assert figure.identified is (top_hz > natural_hz)
