"""Sentences that say what in a plan hides an effect and what would show it."""

import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from posed import posed

from inertial import effects, poses
from inertial.planning import visibility
from inertial.planning.reasons import reason

PLAIN = ("bias", "scale", "misalignment")
THERMAL = (*PLAIN, "bias_temperature", "scale_temperature")


def planned(name, temperatures=(25.0,)):
    angles, soaks = poses.plan(name), len(temperatures)
    n = len(angles)
    temperature = np.repeat(np.asarray(temperatures, dtype=float), n)
    time = 12.0 * np.arange(n * soaks) + 900.0 * np.repeat(np.arange(soaks) + 1, n)
    wander = np.random.default_rng(0).normal(size=(2, time.size))
    return posed(
        np.tile(angles, (soaks, 1)), time=time, temperature=temperature, chamber=temperature, since_power=time,
        since_move=7.0 + 0.05 * wander[0], supply=3.3 + 1e-3 * wander[1],
        vibration=1e-3 * (1.0 + 0.1 * np.abs(wander[0])), slot=np.zeros(()),
    )  # fmt: skip


ONE, WARM = (25.0,), (0.0, 25.0, 50.0)
SAID = [  # plan, temperatures, effect, base, parts of the sentence
    ("orthogonal24", ONE, "cross_coupling", PLAIN, "β in 90° steps makes fx·fy zero: Kip is invisible; add poses at β = 45°"),
    ("six", ONE, "third_order", PLAIN, "collinear with scale", "K3 is confounded with scale", "; add poses at β = 45°"),
    ("fibonacci24", ONE, "bias_temperature", PLAIN, "a single temperature makes θ zero: kT is invisible; add soaks at"),
    ("fibonacci24", (40.0,), "bias_temperature", PLAIN, "collinear with bias"),
    ("six", WARM, "bias_temperature_cubic", THERMAL, "3 temperatures only makes θ³ collinear with bias_temperature"),
    ("fibonacci24", WARM, "slot_rotation", THERMAL, "collinear with misalignment in every pose and at every temperature"),
    ("fibonacci24", WARM, "gravity_value", THERMAL, "a surveyed value of gravity"),
    ("six", ONE, "second_order", (*PLAIN, "scale_asymmetry"), "scale_asymmetry", "K2 is confounded with"),
]  # fmt: skip


@each(SAID)
def test_what_hides_an_effect_and_what_shows_it_is_said(row):
    plan, temperatures, effect, base, *parts = row
    said = reason(planned(plan, temperatures), effect, base)
    assert all(part in said for part in parts), said


def test_soaks_in_one_direction_a_quantity_that_was_not_recorded_and_one_axis_alone_are_said():
    said = reason(planned("six", (0.0, 20.0, 40.0, 60.0)), "aging_linear", THERMAL)
    assert said.startswith("soaks in one direction only makes t collinear with")
    assert "bias_temperature" in said
    assert said.endswith("add soaks on the way back, at 40, 20, 0 °C")
    said = reason(posed(poses.plan("six")), "supply_sensitivity", PLAIN)
    assert said == "the dwells carry no supply_V: kV is invisible; record supply_V"
    state = posed([(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (-90.0, 0.0), (45.0, 0.0), (135.0, 0.0), (90.0, 90.0)])
    assert reason(state, "cross_coupling", PLAIN) == ""
    assert "β in 90° steps" in reason(state, "cross_coupling", PLAIN, axis=0)


@pytest.mark.parametrize(
    "plan", mostly_slow(["six", "twelve", "orthogonal24", "eighteen", "twenty_six", "fibonacci24"], "six")
)
@pytest.mark.parametrize("temperatures", [(25.0,), (0.0, 25.0, 50.0), (25.0, 60.0, -20.0, 26.0)])
def test_every_effect_that_a_plan_does_not_see_has_a_reason_and_a_cure(plan, temperatures):
    state = planned(plan, temperatures)
    base = PLAIN if len(temperatures) == 1 else THERMAL
    for sight in visibility.visibilities(state, base, 1e-5):
        said = reason(state, sight.effect, base)
        assert bool(said) != sight.seen
        if said:
            assert "; " in said
            assert effects.get(sight.effect).symbol.split(",")[0] in said
