"""A unit whose output is constant zero gets its figures as not determined, with the reason; another unit keeps its own."""

import numpy as np
import pandas as pd
import pytest

from pipelines.procedures import PROCEDURES
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, ProcedureStep, UnitRecord
from schemas.recipe import Recipe

SCALE = 0.007
DEVICE = Device({}, {}, full_scale=0.1, out_unit="V")


def made(kind: str, step: ProcedureStep, number: int, rng: np.random.Generator) -> ProcedureRecord:
    """A record of a live unit, a still one, and the reference."""
    if kind == "tilt":
        time = np.arange(20) / 10.0
        alpha = np.radians(step.setting["angle_deg"])
        force = np.tile([0.0, np.sin(alpha), np.cos(alpha)], (20, 1))
    else:
        time = np.arange(int((step.lasting_s or 0.0) * 20000.0)) / 20000.0
        wave = step.setting["level_g"] * np.cos(2.0 * np.pi * step.setting["frequency_hz"] * time)
        force = np.outer(wave, [1e-3, 1e-3, 1.0])
    live = SCALE * force + rng.normal(0.0, 1e-6, force.shape)
    samples = {"live": UnitRecord(time, live), "still": UnitRecord(time, np.zeros_like(force))}
    angle = step.setting.get("angle_deg", 0.0)
    readings = pd.DataFrame([{"unit": unit, "outer_deg": angle, "unit_C": 25.0} for unit in samples])
    if kind == "sweep":
        samples[REFERENCE] = UnitRecord(time, force + rng.normal(0.0, 1e-5, force.shape))
    return ProcedureRecord(number, step, readings, samples)


@pytest.mark.parametrize(
    ("kind", "keys", "reason"),
    [
        ("tilt", {"step_deg": 30.0}, "constant; check the unit"),
        ("sweep", {"low_hz": 20.0, "high_hz": 500.0, "per_octave": 2, "nominal_scale": SCALE}, "check cable and range"),
    ],
)
def test_a_still_unit_has_no_figures_and_says_why(kind: str, keys: dict[str, float], reason: str) -> None:
    procedure = PROCEDURES[kind]
    part = procedure.part(kind=kind, **keys)
    recipe = Recipe.model_construct()
    rng = np.random.default_rng(5)
    records = [made(kind, step, k, rng) for k, step in enumerate(procedure.steps(part, recipe))]
    points = procedure.reduce(part, records, DEVICE)
    outcome = procedure.evaluate(part, points, DEVICE)
    still, live = outcome.figures["still"], outcome.figures["live"]
    assert len(still) == len(procedure.figures)
    assert not any(one.identified for one in still)
    assert {one.note for one in still} == {still[0].note}
    assert reason in still[0].note
    assert any(one.identified for one in live)
    assert procedure.chart(part, points[points["unit"] == "still"]) is None
    assert procedure.chart(part, points[points["unit"] == "live"]) is not None


def test_the_end_of_the_range_is_seen_where_the_converter_rounds_it() -> None:
    """An analogue output of 0.35 V reads 0.34999999 V behind 24 bits, and 7 mV/g make it 49.999998 g."""
    device = Device({}, {}, 0.35, "V")
    assert device.at_end(np.array([0.0, 0.34999999, -0.34999999, 0.349])) == 2
