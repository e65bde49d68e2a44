"""The figures of a centrifuge are those of the axis that was radial."""

import numpy as np
import pandas as pd
import pytest
from spun_centrifuge import spins, spun

from pipelines.procedures import PROCEDURES
from pipelines.procedures.recorded import Device

CENTRIFUGE = PROCEDURES["centrifuge"]


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize("radii", [None, [0.5, 0.3]])
@pytest.mark.parametrize("broken", [False, True])
def test_figures_have_the_axis_of_the_points(
    axis: str, radii: list[float] | None, rng: np.random.Generator, *, broken: bool
) -> None:
    points = spins(tuple(radii or (0.5,)))
    value, error, _ = spun(points, {}, rng)
    rows = pd.DataFrame(
        {"unit": "A1", "axis": axis, "series": "output", "point": np.arange(value.size), "setting": points.acceleration,
         "value": np.nan if broken else value, "uncertainty": error, "spread": 1e-4, "radius_m": points.radius_m}
    )  # fmt: skip
    content = {"kind": "centrifuge", "forces_g": sorted({*np.abs(points.acceleration).tolist()}), "full_scale_g": 30.0}
    content |= {"radii_m": radii} if radii else {"radius_m": 0.5}
    part = CENTRIFUGE.part.model_validate(content)
    figures = CENTRIFUGE.evaluate(part, rows, Device({}, {}, 30.0, "g")).figures["A1"]
    assert len(figures) == len(CENTRIFUGE.figures)
    assert {one.axis for one in figures} == {axis}
