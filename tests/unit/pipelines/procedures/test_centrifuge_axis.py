"""The figures of a centrifuge are those of the axis that was radial."""

from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from spun_centrifuge import spins, spun

from pipelines.procedures import PROCEDURES
from pipelines.procedures.figures import FigureValue
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, ProcedureStep, Taken, UnitRecord, at_rest

CENTRIFUGE: Any = PROCEDURES["centrifuge"]


@pytest.mark.parametrize("axis", ["x", "z"])
@pytest.mark.parametrize("radii", [None, [0.5, 0.3]])
@pytest.mark.parametrize("fault", ["", "clipped", "one point off"])
def test_figures_have_the_axis_of_the_points(
    axis: str, radii: list[float] | None, rng: np.random.Generator, fault: str
) -> None:
    points = spins(tuple(radii or (0.5,)))
    value, error, _ = spun(points, {}, rng)
    value[9] += 40.0 * error[9] * (fault == "one point off")
    rows = pd.DataFrame(
        {"unit": "A1", "axis": axis, "series": "output", "point": np.arange(value.size), "setting": points.acceleration,
         "value": np.nan if fault == "clipped" else value, "uncertainty": error, "spread": 1e-4, "radius_m": points.radius_m}
    )  # fmt: skip
    content = {"kind": "centrifuge", "forces_g": sorted({*np.abs(points.acceleration).tolist()}), "full_scale_g": 30.0}
    content |= {"radii_m": radii} if radii else {"radius_m": 0.5}
    part = CENTRIFUGE.part.model_validate(content)
    figures = CENTRIFUGE.evaluate(part, rows, Device({}, {}, 30.0, "g")).figures["A1"]
    assert len(figures) == len(CENTRIFUGE.figures)
    assert {one.axis for one in figures} == {axis}
    assert any(one.identified for one in figures) == (not fault)
    if fault == "one point off":
        assert {one.note for one in figures} == {f"measure {points.acceleration[9]:+.4g} g again: it departs alone"}


RADIUS_M, SENSOR_M = 0.5, 0.4
SENSOR = {"kind": "centrifuge", "scale": 1.0, "radius_m": RADIUS_M, "full_scale_g": 30.0}
SENSOR |= {"reference_radius_m": SENSOR_M, "reference_ppm": 2500.0, "reference_linearity_ppm": 100.0}


def turned(stretch: float, gain: float) -> list[Taken]:
    """Records of a unit without errors on an arm that stretches, with a sensor of a gain of its own beside it."""
    rng, taken = np.random.default_rng(7), list[Taken]()
    for number, (way, force) in enumerate(product((1.0, -1.0), (1.0, 5.0, 10.0, 20.0, 30.0))):
        omega = np.sqrt(force * 9.80665 / RADIUS_M)
        felt = force * (1.0 + stretch * omega**2)
        read = np.zeros((50, 3))
        read[:, 0] = np.degrees(omega)
        read[:, 1] = felt * SENSOR_M / RADIUS_M * gain * (1.0 + 1e-5 * rng.standard_normal(50))
        output = np.zeros((1000, 3))
        output[:, 2] = way * felt + 1e-4 * rng.standard_normal(1000)
        setting = {"radius_m": RADIUS_M, "direction": way}
        step = ProcedureStep("spin", at_rest("spin"), 25.0, role="centrifuge", setting=setting)
        reference = UnitRecord(np.arange(50) / 10.0, read)
        record = ProcedureRecord(number, step, pd.DataFrame(), {REFERENCE: reference})
        taken.append(Taken(number, record, "A1", {}, UnitRecord(np.arange(1000) / 200.0, output)))
    return taken


def of_sensor(stretch: float, gain: float, **keys: float) -> tuple[dict[str, FigureValue], list[str]]:
    part, device = CENTRIFUGE.part.model_validate(SENSOR | keys), Device({}, {}, 50.0, "V")
    rows = pd.DataFrame([row for one in turned(stretch, gain) for row in CENTRIFUGE.points(part, one, device)])
    outcome = CENTRIFUGE.evaluate(part, rows, device)
    return {one.figure: one for one in outcome.figures["A1"]}, [one.text for one in outcome.findings]


def test_a_sensor_on_the_arm_takes_the_stretch_of_the_arm_with_it() -> None:
    figures, texts = of_sensor(stretch=2e-7, gain=1.0)
    third = figures["centrifuge_third_order_ug_g3"]
    assert abs(third.value) < 4.0 * third.uncertainty
    assert abs(figures["centrifuge_sensitivity_percent"].value) < 0.01
    assert figures["centrifuge_sensitivity_percent"].uncertainty == pytest.approx(0.25, rel=0.01)
    assert any(text.startswith("reads +") and "beside rω²" in text for text in texts)
    figures, _ = of_sensor(stretch=0.0, gain=1.002)  # the error of the sensor is that of the sensitivity
    assert figures["centrifuge_sensitivity_percent"].value == pytest.approx(-0.2, abs=0.01)
    dead, _ = of_sensor(stretch=0.0, gain=0.0)
    assert "check its cable" in dead["centrifuge_linearity_percent"].note


def test_what_is_stated_of_rate_and_linearity_is_in_every_point_of_a_sensor() -> None:
    def errors(**keys: float) -> np.ndarray:
        part = CENTRIFUGE.part.model_validate(SENSOR | keys)
        rows = [row for one in turned(0.0, 1.0) for row in CENTRIFUGE.points(part, one, Device({}, {}, 50.0, "V"))]
        return np.array([row["uncertainty"] / abs(row["setting"]) for row in rows])

    none = errors(point_ppm=0.0, reference_linearity_ppm=0.0)
    for key in ("point_ppm", "reference_linearity_ppm"):
        one = errors(**{"point_ppm": 0.0, "reference_linearity_ppm": 0.0, key: 300.0})
        assert np.sqrt(one**2 - none**2) == pytest.approx(300e-6, rel=1e-3)


@pytest.mark.parametrize("key", ["reference_ppm", "reference_linearity_ppm"])
def test_a_statement_on_a_sensor_that_is_not_there_is_refused(key: str) -> None:
    with pytest.raises(ValidationError, match=f"{key}: given without reference_radius_m, which is needed"):
        CENTRIFUGE.part.model_validate({"kind": "centrifuge", "scale": 1.0, key: 100.0})
