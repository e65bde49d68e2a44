"""What a fresh run and dwells left out confirm in worlds that nobody prepared, and that no fault of a run is confirmed."""

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from each import each
from long_suites import mostly_slow
from made_worlds import BASE, Noise, World, force_of, make

from benchmarks.truth import Spec, make_run
from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.confirmation import text_of
from pipelines.diagnosis.diagnose import examination


@pytest.mark.slow
@each([("thermal_hysteresis", "half_width", "nine"), ("thermal_lag", "tau", "ramps")])
def test_a_parameter_has_one_value_and_an_interval_that_holds_it(row: tuple[str, str, str]) -> None:
    effect, parameter, soaks = row
    run = make_run(Spec(effects=(effect,), sizes=(2.0,), plan="six", soaks=soaks, units=3), 3)
    document = examination(run.dwells, run.history, None).document
    (group,) = [g for g in document["classes"] if effect in g["effects"]]
    fitted = compare(run.dwells, [*document["effects"], group["nonlinear_of"]], run.history)
    told, own = group["nonlinear"][parameter], fitted["nonlinear"][group["nonlinear_of"]][parameter]
    assert told == pytest.approx(own, rel=0.01)
    for intervals in (group["nonlinear_interval"], fitted["nonlinear_interval"][group["nonlinear_of"]]):
        low, high = intervals[parameter]
        assert (low <= own * 1.01, high >= own * 0.99, low < high) == (True, True, True)


SEED = 5_500_000
Spoil = Callable[[pd.DataFrame], None]


def progress(world: World, effect: str, seed: int, spoil: Spoil | None = None, *, fresh: bool = True) -> dict:
    made = make(world, seed)
    if spoil is not None:
        spoil(made.dwells)
    again = (made.fresh, made.fresh_history) if fresh else (None, None)
    return compare(made.dwells, [*BASE, effect], made.history, *again, before=BASE)["progress"]


CURVE = "bias_temperature_quadratic"
CONFIRMED = [  # units, g by which they come up elsewhere, hidden effect, seed, whether by a fresh run
    (2, 300.0, "third_order", SEED, True),
    # 300 µg more or less hide what the effect takes off the error of the fresh run, unless the run has a bias of its own
    (1, 300.0, CURVE, 63_103, True),
    (4, 0.0, "third_order", SEED + 6, False),
    (1, 300.0, CURVE, 63_107, True),
    (8, 300.0, CURVE, 63_102, True),
    (4, 300.0, "cross_coupling", SEED + 5, True),
    (4, 300.0, "second_order", SEED + 5, True),
    (4, 0.0, CURVE, SEED + 5, True),
    (4, 0.0, "cross_coupling", SEED + 6, False),
]


@pytest.mark.parametrize(("units", "turn_on", "effect", "seed", "fresh"), mostly_slow(CONFIRMED, *CONFIRMED[:3]))
def test_effects_that_are_there_are_confirmed(units, turn_on, effect, seed, fresh):
    evidence = progress(World(units=units, turn_on=turn_on, hidden=((effect, 2.0),)), effect, seed, fresh=fresh)
    assert (evidence["confirmed"], evidence["reason"], evidence["rises"]) == (True, None, None)
    assert effect == CURVE or evidence["fall_ug"] > 2.0 * evidence["fall_u_ug"] > 0.0
    assert not fresh or evidence["part"] == pytest.approx(1.0, abs=4.0 * evidence["part_u"])


SLOW = [CURVE, "aging_log", "thermal_hysteresis", "step_change"]


@pytest.mark.parametrize("effect", mostly_slow(SLOW, "aging_log", "step_change"))
def test_slow_effects_that_are_not_there_are_not_confirmed(effect):
    world = World(units=2, noise=Noise(walk=4.0))
    assert progress(world, effect, SEED)["confirmed"] is not True
    assert progress(world, effect, SEED, fresh=False)["confirmed"] is None


def slipped(dwells: pd.DataFrame) -> None:
    """The table slips on its drive half-way: further out by 0.35 mrad from there on."""
    late = dwells["dwell"] >= dwells["dwell"].max() / 2
    outer, inner = (np.radians(dwells.loc[late, f"{axis}_deg"].to_numpy()) for axis in ("outer", "inner"))
    dwells.loc[late, ["out_x", "out_y", "out_z"]] += force_of(outer + 0.35e-3, inner) - force_of(outer, inner)


def exchanged(dwells: pd.DataFrame) -> None:
    """Two units stand in each other's place after the first soak; the thermometers stay."""
    columns = ["out_x", "out_y", "out_z"]
    one, other = ((dwells["unit"] == unit) & (dwells["dwell"] >= 24) for unit in ("W001", "W002"))
    first, second = dwells.loc[one, columns].to_numpy(), dwells.loc[other, columns].to_numpy()
    dwells.loc[one, columns], dwells.loc[other, columns] = second, first


def misread(dwells: pd.DataFrame) -> None:
    """The thermometer of one soak is 3 K off, for all units."""
    dwells.loc[dwells["dwell"].between(24, 47), "unit_C"] += 3.0


def warming(dwells: pd.DataFrame) -> None:
    """The scale factor of every unit and axis warms up by some 300 µg/g, with a time constant of 40 minutes."""
    size = np.random.default_rng(4).uniform(200e-6, 400e-6, (dwells["unit"].nunique(), 3))
    place = dwells["unit"].str[1:].astype(int).to_numpy() - 1
    since = dwells["time_s"] - dwells["time_s"].min()
    for k, name in enumerate("xyz"):
        dwells[f"out_{name}"] *= 1.0 + size[place, k] * np.exp(-since / 2400.0)


IMITATED = [
    (1, slipped, "outer_encoder_offset", "no clear fall"),
    (1, slipped, "cross_coupling", "no clear fall"),
    (4, exchanged, "misalignment_temperature", "left out"),
    (4, exchanged, "scale_temperature_quadratic", "fault|names"),
    (4, misread, "scale_temperature_quadratic", "names soak_thermometer"),
    (4, warming, "scale_temperature_quadratic", "names|not adequate"),
]


@pytest.mark.parametrize(("units", "spoil", "effect", "reason"), mostly_slow(IMITATED, *IMITATED[:4]))
def test_dwells_left_out_of_one_run_do_not_confirm_what_imitates_its_fault(units, spoil, effect, reason):
    evidence = progress(World(units=units), effect, SEED + 7, spoil, fresh=False)
    assert evidence["log_density"] > 4.0  # it predicts what is left out
    assert evidence["confirmed"] is None
    assert re.search(reason, evidence["reason"]), evidence["reason"]
    text = text_of({"removed": []}, evidence)
    assert text.startswith("not decided by this run alone: stretches of time left out confirm it")
    assert "a fresh run of the same units decides" in text


def test_what_imitates_a_slip_is_not_confirmed_by_a_fresh_run():
    assert progress(World(units=1), "cross_coupling", SEED + 7, slipped)["confirmed"] is False
