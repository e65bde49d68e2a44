"""An exposure on the simulated station: a package with play keeps a shift, one without keeps none."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from small_station import captured, lot_of, short_recipe, station_of

from inertial.frames import force_from_angles
from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable
from pipelines.procedures.figures import Outcome
from pipelines.procedures.recorded import Device, nominal_device, procedure_record
from pipelines.schedule.steps import steps
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.simulation import Hidden
from schemas.station import StationConfig, load_station

EXPOSURE: Any = PROCEDURES["exposure"]
CALM = {"bias_instability_ug": 5.0, "rate_random_walk_ug": 0.0}
WIDTH_K, GAIN = 10.0, 400e-6
ROOM_C = 23.0
BIAS, SCALE = "exposure_bias_shift_ug", "exposure_scale_shift_ppm"


def recipe_of(**keys: Any) -> Recipe:
    part = {"kind": "exposure", "scale": 256000.0, "low_C": -10.0, "high_C": 60.0, "cycles": 1, **keys}
    return short_recipe().model_copy(update={"procedures": [part], "soak_min_s": 900.0})


def measured(config: StationConfig) -> tuple[pd.DataFrame, Device]:
    recipe, lot = recipe_of(), lot_of(2)
    sink = captured(recipe, lot, config)
    readings = sink.all(1)
    records = [
        procedure_record(k, step.order, [sink.records[k][0]], readings[readings["record"] == k])
        for k, step in enumerate(steps(recipe))
        if step.order is not None
    ]
    device = nominal_device(readings)
    return EXPOSURE.reduce(parts_of(recipe)[0], records, device), device


def outcome(points: pd.DataFrame, device: Device) -> Outcome:
    part = parts_of(recipe_of())[0]
    assert EXPOSURE.chart(part, points).plots[0].traces
    made: Outcome = EXPOSURE.evaluate(part, points, device)
    return made


def test_play_in_the_package_is_a_shift_of_the_bias_and_of_no_scale() -> None:
    play = Hidden(kind="hysteresis_play", figures={"width": WIDTH_K, "gain": GAIN})
    found = outcome(*measured(station_of(preset_overrides=CALM, hidden=[play.model_dump()])))
    for figures in found.figures.values():
        by_name = {one.figure: one for one in figures}
        bias, scale = by_name[BIAS], by_name[SCALE]
        # the pin was free at room temperature, and lies half the play above the device when it has come down from the heat
        assert bias.value == pytest.approx(1e6 * GAIN * (0.5 * WIDTH_K + 25.0 - ROOM_C), rel=0.1)
        assert bias.value > 6.0 * bias.uncertainty
        assert abs(scale.value) < 4.0 * scale.uncertainty


def test_a_device_that_keeps_nothing_has_no_shift_beyond_u() -> None:
    points, device = measured(station_of(preset_overrides=CALM))
    for figures in outcome(points, device).figures.values():
        assert all(abs(one.value) < 4.0 * one.uncertainty for one in figures)
        assert all(np.isfinite(one.uncertainty) for one in figures)
    silent = points[(points["unit"] != "U001") | (points["series"] == "before")]
    lost = outcome(silent, device).figures
    assert all(one.identified for one in lost["U000"])
    assert {one.note for one in lost["U001"]} == {
        "exposure: no records after it, both are needed; check the unit and its seat"
    }


def test_temperatures_out_of_order_or_beyond_the_station_are_refused() -> None:
    with pytest.raises(RecipeInvalid, match="exchange them"):
        parts_of(recipe_of(low_C=60.0, high_C=-10.0))
    with pytest.raises(RecipeInvalid, match="high_C 125 °C, -40 to 85 °C is allowed"):
        refuse_unusable(recipe_of(high_C=125.0), load_station())
    with pytest.raises(RecipeInvalid, match="temperature_C 95 °C, -40 to 85 °C is allowed"):
        refuse_unusable(recipe_of(temperature_C=95.0), load_station())
    station = load_station()
    narrow = station.model_copy(update={"limits": station.limits.model_copy(update={"inner_deg": (-45.0, 200.0)})})
    with pytest.raises(RecipeInvalid, match="face -x: inner axis -90 deg, -45 to 200 deg is allowed"):
        refuse_unusable(recipe_of(), narrow)


def test_no_face_is_measured_twice_without_a_move() -> None:
    poses = [
        (step.pose.outer_deg, step.pose.inner_deg) for step in EXPOSURE.steps(parts_of(recipe_of())[0], recipe_of())
    ]
    names = [step.name.split()[-1] for step in EXPOSURE.steps(parts_of(recipe_of())[0], recipe_of())]
    same_soak = [k % 6 != 5 or k // 6 in (0, 4) for k in range(len(names) - 1)]
    assert len(poses) == 6 * (2 + 2 + 2)
    assert all(a != b for a, b, same in zip(poses, poses[1:], same_soak, strict=False) if same)


LETTERS = {"x": 0, "y": 1, "z": 2}
FLAT = {"white": 0.0, "flicker": 0.0, "flicker_error": 0.0}


def warmer(
    rng: np.random.Generator,
    *,
    bias_ug_K: float,
    scale_ppm_K: float,
    curved: float,
    apart_K: float,
    missing: bool = False,
) -> Outcome:
    """A device with temperature coefficients and no shift, whose records after the exposure are at a higher temperature."""
    steps_ = EXPOSURE.steps(parts_of(recipe_of())[0], recipe_of())
    rows = list[dict[str, Any]]()
    for k, step in enumerate(steps_):
        series = step.name.split()[0]
        at = step.temperature_C + (apart_K if series == "after" else 0.0) + 0.02 * rng.standard_normal()
        theta = at - 25.0
        force = force_from_angles(*np.radians([step.pose.outer_deg, step.pose.inner_deg]))
        for axis, i in LETTERS.items():
            value = (
                bias_ug_K * theta + curved * theta**2 + force[i] * (1e6 + scale_ppm_K * theta) + rng.standard_normal()
            )
            rows.append(
                {"unit": "U1", "axis": axis, "series": series if series in {"before", "after"} else "exposure", "point": k,
                 "setting": 60.0 * k, "value": value, "uncertainty": 1.0, "temperature": np.nan if missing else at,
                 **{f"force_{name}": force[j] for name, j in LETTERS.items()}, **FLAT}
            )  # fmt: skip
    return outcome(pd.DataFrame(rows), Device({}, {}, 10.0, "g"))


@pytest.mark.parametrize(
    ("bias_ug_K", "scale_ppm_K", "curved"), [(0.0, 200.0, 0.0), (150.0, 0.0, 0.0), (80.0, -120.0, 1.0)]
)
def test_a_difference_of_temperature_is_no_shift(bias_ug_K: float, scale_ppm_K: float, curved: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        made = warmer(rng, bias_ug_K=bias_ug_K, scale_ppm_K=scale_ppm_K, curved=curved, apart_K=0.5)
        for one in made.figures["U1"]:
            assert abs(one.value) < 4.0 * one.uncertainty
            assert one.uncertainty < 3.0
        assert not made.findings


def test_without_temperatures_nothing_is_corrected_and_a_finding_says_so() -> None:
    made = warmer(np.random.default_rng(3), bias_ug_K=0.0, scale_ppm_K=200.0, curved=0.0, apart_K=0.5, missing=True)
    assert all(np.isfinite(one.value) for one in made.figures["U1"])
    assert [one.text for one in made.findings] == [
        "not corrected for, its difference is in both shifts and not in U: the unit's temperature is not recorded"
    ]
