"""An exposure on the simulated station: a package with play keeps a shift, one without keeps none."""

from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from numpy.typing import NDArray
from procedure_records import procedure_records
from scipy import optimize, signal
from small_station import captured, lot_of, short_recipe, station_of

from inertial.frames import force_from_angles
from pipelines.procedures import PROCEDURES, parts_of, refuse_unusable, roles_of
from pipelines.procedures.exposure import PLAIN
from pipelines.procedures.figures import FigureValue, Outcome
from pipelines.procedures.recorded import Device
from schemas.errors import RecipeInvalid
from schemas.recipe import Recipe
from schemas.simulation import Hidden
from schemas.station import StationConfig, load_station
from schemas.station_devices import Equipment
from stations.plant.device import stream
from stations.plant.fixture import DAMPER_S
from stations.plant.hidden import hidden_effect

Array = NDArray[np.float64]
EXPOSURE: Any = PROCEDURES["exposure"]
CALM = {"bias_instability_ug": 5.0, "rate_random_walk_ug": 0.0}
WIDTH_K, GAIN = 10.0, 400e-6
ROOM_C = 23.0
BIAS, SCALE = "exposure_bias_shift_ug", "exposure_scale_shift_ppm"
BIAS_IN, SCALE_IN = "exposure_bias_change_ug", "exposure_scale_change_ppm"


def recipe_of(**keys: Any) -> Recipe:
    part = {"kind": "exposure", "scale": 256000.0, "low_C": -10.0, "high_C": 60.0, "cycles": 1, **keys}
    return short_recipe().model_copy(update={"procedures": [part], "soak_min_s": 900.0})


def measured(config: StationConfig, recipe: Recipe | None = None, units: int = 2) -> tuple[pd.DataFrame, Device]:
    recipe, lot = recipe or recipe_of(), lot_of(units)
    sink = captured(recipe, lot, config, roles=roles_of(recipe))
    records, device = procedure_records(recipe, sink)
    return EXPOSURE.reduce(parts_of(recipe)[0], records, device), device


def outcome(points: pd.DataFrame, device: Device, recipe: Recipe | None = None) -> Outcome:
    part = parts_of(recipe or recipe_of())[0]
    assert EXPOSURE.chart(part, points).plots[0].traces
    made: Outcome = EXPOSURE.evaluate(part, points, device)
    return made


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_device_that_keeps_nothing_has_no_shift_beyond_u() -> None:
    points, device = measured(station_of(preset_overrides=CALM))
    for figures in outcome(points, device).figures.values():
        shifts = [one for one in figures if one.figure in {BIAS, SCALE}]
        assert all(abs(one.value) < 4.0 * one.uncertainty for one in shifts)
        assert all(np.isfinite(one.uncertainty) for one in shifts)
        assert {one.note for one in figures if one not in shifts} == {PLAIN}
    silent = points[(points["unit"] != "U001") | (points["series"] == "before")]
    lost = outcome(silent, device).figures
    assert all(one.identified for one in lost["U000"] if one.figure in {BIAS, SCALE})
    assert {one.note for one in lost["U001"]} == {
        "exposure: no records after it, both are needed; check the unit and its seat"
    }


def of_profile(**keys: Any) -> Recipe:
    return recipe_of().model_copy(update={"procedures": [{"kind": "exposure", "scale": 256000.0, **keys}]})


NARROW = load_station().limits.model_copy(update={"inner_deg": (-45.0, 200.0)})
NA, DB = {"profile": "iec_60068_2_14_na"}, {"profile": "iec_60068_2_30_db"}


REFUSED = [
    (recipe_of(low_C=60.0, high_C=-10.0), {}, "exchange them"),
    (recipe_of(high_C=125.0), {}, "high_C 125 °C, -40 to 85 °C is allowed"),
    (recipe_of(temperature_C=95.0), {}, "temperature_C 95 °C, -40 to 85 °C is allowed"),
    (recipe_of(), {"limits": NARROW}, "face -x: inner axis -90 deg, -45 to 200 deg is allowed"),
    (of_profile(profile="iec_60068_2_30"), {}, "no exposure profile 'iec_60068_2_30'"),
    (of_profile(**NA), {}, "low_C: missing, profile iec_60068_2_14_na has none of its own"),
    (of_profile(**DB, pressure_hPa=300.0), {}, "pressure_hPa: profile iec_60068_2_30_db has no such level"),
]


@each(REFUSED)
def test_temperatures_out_of_order_or_beyond_the_station_and_levels_of_no_profile_are_refused(
    row: tuple[Recipe, dict[str, Any], str],
) -> None:
    with pytest.raises(RecipeInvalid, match=row[2]):
        refuse_unusable(row[0], load_station().model_copy(update=row[1]))


def test_rates_of_a_profile_are_those_of_its_standard_and_the_chamber_alone_carries_an_exposure_out() -> None:
    (rates,) = parts_of(of_profile(profile="iec_60068_2_14_nb", low_C=-40.0, high_C=85.0))
    assert [leg.change_s / 60.0 for _, _, leg in rates.legs()] == [65.0, 125.0, 125.0, 125.0]
    refuse_unusable(recipe_of(), load_station().model_copy(update={"equipment": Equipment(built_in=False)}))
    faces = [
        (step.pose.outer_deg, step.pose.inner_deg) for step in EXPOSURE.steps(parts_of(recipe_of())[0], recipe_of())
    ]
    assert len(faces) == 6 * (2 + 2 + 2)
    for k, (one, other) in enumerate(pairwise(faces)):  # none is measured twice without a move
        assert one != other or (k % 6 == 5 and k // 6 not in (0, 4))


LETTERS = {"x": 0, "y": 1, "z": 2}
FLAT = {"white": 0.0, "flicker": 0.0, "flicker_error": 0.0}


def warmer(
    rng: np.random.Generator, *, bias_ug_K: float, scale_ppm_K: float, curved: float, missing: bool = False
) -> Outcome:
    """A device with temperature coefficients and no shift, whose records after the exposure are 0.5 K warmer."""
    steps_ = EXPOSURE.steps(parts_of(recipe_of())[0], recipe_of())
    rows = list[dict[str, Any]]()
    for k, step in enumerate(steps_):
        series = step.name.split()[0]
        at = step.temperature_C + (0.5 if series == "after" else 0.0) + 0.02 * rng.standard_normal()
        theta = at - 25.0
        force = force_from_angles(*np.radians([step.pose.outer_deg, step.pose.inner_deg]))
        for axis, i in LETTERS.items():
            value = bias_ug_K * theta + curved * theta**2 + force[i] * (1e6 + scale_ppm_K * theta)
            value += rng.standard_normal()
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
    for _ in range(6):
        made = warmer(rng, bias_ug_K=bias_ug_K, scale_ppm_K=scale_ppm_K, curved=curved)
        for one in made.figures["U1"][:2]:
            assert abs(one.value) < 4.0 * one.uncertainty
            assert one.uncertainty < 3.0
        assert not made.findings


def test_without_temperatures_nothing_is_corrected_and_a_finding_says_so() -> None:
    made = warmer(np.random.default_rng(3), bias_ug_K=0.0, scale_ppm_K=200.0, curved=0.0, missing=True)
    assert all(np.isfinite(one.value) for one in made.figures["U1"][:2])
    assert [one.text for one in made.findings] == [
        "not corrected for, its difference is in both shifts and not in U: the unit's temperature is not recorded"
    ]


def exposed(profile: str, hidden: Hidden, units: int = 2, **keys: Any) -> tuple[Outcome, pd.DataFrame, Array]:
    """What is found of a lot with a hidden effect of its package, its points, and the senses of the effect, (units, 3)."""
    recipe = of_profile(profile=profile, **keys)
    config = station_of(preset_overrides=CALM, hidden=[hidden.model_dump()], slot_lag_s=(LAG_S, LAG_S))
    points, device = measured(config, recipe, units)
    effect: Any = hidden_effect(hidden.kind, hidden.figures)
    effect.begin(units, stream(lot_of(units).seed, "hidden", 0))
    return outcome(points, device, recipe), points, effect._sign


def agrees(made: Outcome, name: str, truth: Array, share: float = 0.0) -> None:
    """The figure of each unit is that of the axis where the truth (units, 3) is largest, within U and a share of it."""
    for row, figures in zip(truth, made.figures.values(), strict=True):
        found = one_of(figures, name)
        axis = "xyz".index(found.axis)
        assert abs(row[axis]) >= 0.8 * np.abs(row).max()
        assert abs(found.value - row[axis]) < 3.0 * found.uncertainty + share * abs(row[axis]), (name, found, row)


def one_of(figures: list[FigureValue], name: str) -> FigureValue:
    return next(one for one in figures if one.figure == name)


LAG_S = 100.0


def largest_lag(change_K: float, over_s: float) -> float:
    """Largest difference of shell and die when the air changes on a line: three poles one behind the other, by scipy."""
    time = np.linspace(0.0, 3000.0, 30_001)
    air = change_K * np.clip(time / over_s, 0.0, 1.0)
    shell = signal.lsim(([1.0], np.polymul([DAMPER_S, 1.0], [LAG_S, 1.0])), air, time)[1]
    die = signal.lsim(([1.0], [60.0, 1.0]), shell, time)[1]
    return float(np.max(die - shell))


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["mil_std_810_temperature_shock", "temperature_variation"])
def test_adhesive_yields_in_shocks_of_cold_and_not_in_slow_cycles(profile: str) -> None:
    shock = profile != "temperature_variation"
    hidden = Hidden(kind="yielding_adhesive", figures={"gain": 100e-6, "scale": 50e-6})
    made, points, sign = exposed(profile, hidden, 1, low_C=-40.0, high_C=85.0, cycles=1)
    # the fall from the heat to the temperature of the test, in the recovery, is smaller than the first and changes nothing
    flowed = 20.0 + largest_lag(-40.0 - 25.0, 60.0) - 30.0 if shock else 0.0
    agrees(made, BIAS, 100.0 * flowed * sign, 0.08)
    if shock:
        agrees(made, SCALE, 50.0 * flowed * sign, 0.1)
        legs = points[points["series"] == "leg"]
        assert (legs["reached_C"] - legs["ordered_C"]).abs().max() < 0.5
        assert made.findings[-1].text.startswith(f"{profile}: 3 legs, air at their ends within")


@pytest.mark.slow
def test_a_lid_bends_at_altitude_and_what_leaked_out_remains() -> None:
    hidden = Hidden(kind="leaky_lid", figures={"leak_h": 10.0, "deflection": 0.05, "scale": 0.01})
    made, points, sign = exposed("iec_60068_2_13_m", hidden)
    assert set(points["series"]) == {"dry", "before", "leg", "exposure", "after"}

    def bent(difference_hPa: float) -> float:
        root: Any = optimize.brentq(lambda w: w + 0.2 * w**3 - 1e-3 * difference_hPa, -2.0, 2.0)
        return float(root)

    warm = 298.15 / (273.15 + 23.0)
    still = bent(1013.25 * warm - 1013.25)
    hours = 2.5  # of low pressure until the middle of the poses in it: 10 min down, 2 h, the soak
    inside = 300.0 + (1013.25 * warm - 300.0) * np.exp(-hours / 10.0)
    agrees(made, BIAS_IN, 1e6 * 0.05 * (bent(inside - 300.0) - still) * sign, 0.03)
    agrees(made, SCALE_IN, 1e6 * 0.01 * (bent(inside - 300.0) - still) * sign, 0.03)
    for figures in made.figures.values():
        after = one_of(figures, BIAS)
        assert after.value * one_of(figures, BIAS_IN).value < 0.0  # less gas than before: the lid bends inwards
        assert abs(after.value) > 6.0 * after.uncertainty


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_damp_heat_swells_the_moulding_and_it_has_not_dried_after_the_recovery() -> None:
    hidden = Hidden(kind="moisture_diffusion", figures={"swelling": 0.02, "scale": 0.005})
    made, _, sign = exposed("iec_60068_2_30_db", hidden, cycles=1)
    # at 55 °C the plate is full within 12 h (time constant 1.4 h). For the dry poses there it has lost water for less than an
    # hour: the room's air (45 % at 23 °C, vapour pressure 28.1 of 157.6 hPa) holds 8 % there
    driest = 0.08 + (0.45 - 0.08) * np.exp(-1.0 / 1.4)
    for row, figures in zip(sign, made.figures.values(), strict=True):
        change, shift = one_of(figures, BIAS_IN), one_of(figures, BIAS)
        saturated = change.value / (1e6 * 0.02 * row["xyz".index(change.axis)])
        assert 0.93 - 0.45 < saturated < 0.93 - driest
        assert 0.3 < shift.value / change.value < 1.0
