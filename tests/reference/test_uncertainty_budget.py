"""The uncertainty budget against published and independently computed figures, a Monte Carlo, and closed forms.

Figures of a workshop's station: computed for this project by another implementation, confirmed by closed forms.
Gravity: GRS 1980 (Moritz). GUM H.1: JCGM 100:2008, annex H.1. Risks: JCGM 106:2012; suncal 1.7.1 gives the same to 1e-13.
"""

import math
from statistics import NormalDist

import numpy as np
import pytest
from each import each
from independent_budget import PRODUCTION, columns, draws, fitted, nominal_force, outputs
from long_suites import mostly_slow
from posed import posed

from inertial import design, poses
from inertial.state import State
from inertial.uncertainty import period
from inertial.uncertainty.degrees import coverage_factors, effective_degrees
from inertial.uncertainty.influences import (
    Errors,
    InputQuantity,
    MeasurementModel,
    Scattered,
    harmonic,
    sensitivity,
    theta,
)
from inertial.uncertainty.period import YEAR_S, Windows, flicker_later, flicker_within
from inertial.uncertainty.propagation import fit_design, norm_errors, propagated
from inertial.uncertainty.risk import lot_risk
from inertial.uncertainty.rounding import rounded
from schemas.decisions import outside
from schemas.uncertainty import formula_gravity

BASE = ("bias", "scale", "misalignment")
WARM = ("bias_temperature", "bias_temperature_quadratic", "scale_temperature", "scale_temperature_quadratic")
PLANS = {"six": ("six", (25.0,)), "twelve": ("twelve", (0.0, 25.0, 50.0)), "fib": ("fibonacci24", (-10.0, 25.0, 60.0))}
VERIFICATION = [[35.0, 15.0], [70.0, 140.0], [105.0, -100.0], [140.0, 60.0], [55.0, -35.0], [125.0, -160.0]]


def state_of(angles: np.ndarray, temperatures: tuple[float, ...]) -> State:
    read = np.repeat(np.array(temperatures), len(angles))
    return posed(np.tile(angles, (len(temperatures), 1)), 30.0, temperature=read)


def model_of(effects: tuple[str, ...]) -> MeasurementModel:
    values = {"scale": 1.0, "bias_temperature": 50e-6, "scale_temperature": 200e-6}
    names = [design.local_names(design.split(effects)[0], axis) for axis in range(3)]
    return MeasurementModel(effects, np.array([[values.get(effect, 0.0) for effect, _ in own] for own in names]), {})


def unit(axis: int) -> tuple[float, float, float]:
    return tuple(float(k == axis) for k in range(3))  # type: ignore[return-value]


def station(state: State, s: dict[str, float]) -> tuple[list[InputQuantity], list[Scattered]]:
    quantities = [
        InputQuantity("gravity", Errors(gravity=1.0), s["gravity"]),
        InputQuantity("level", Errors(level=(1.0, 0.0)), s["level_1"]),
        InputQuantity("level", Errors(level=(0.0, 1.0)), s["level_2"]),
        InputQuantity("orthogonality", Errors(orthogonality=1.0), s["orthogonality"]),
        InputQuantity("outer_offset", Errors(outer=1.0), s["outer"]),
        InputQuantity("inner_offset", Errors(inner=1.0), s["inner"]),
        InputQuantity("thermometer_offset", Errors(temperature=1.0), s["offset"]),
        InputQuantity("thermometer_slope", Errors(temperature=theta(state)), s["slope"]),
        InputQuantity("gradient", Errors(temperature=1.0), s["gradient"]),
        InputQuantity("supply", Errors(gain=1.0), s["supply"]),
        InputQuantity("gain", Errors(gain=1.0), s["gain"]),
    ]
    for order in (1, 2):
        for phase in ("sin", "cos"):
            for name, angle in (("outer", state.outer), ("inner", state.inner)):
                wave = Errors(**{name: harmonic(angle, order, phase)})
                quantities.append(InputQuantity("harmonics", wave, s["harmonics"]))
    quantities += [InputQuantity("seat", Errors(seat=unit(k)), s["seat"], "mount") for k in range(3)]
    quantities += [InputQuantity("reader", Errors(offset=unit(k)), s["reader"], "slot") for k in range(3)]
    for one in np.unique(state.temperature):
        here = (state.temperature == one).astype(float)
        quantities.append(InputQuantity("soak", Errors(temperature=here), s["soak"], "soak"))
    return quantities, [Scattered("pose", s["pose"], s["pose"])]


def through(plan: str, influences=None, scattered=()):
    name, temperatures = PLANS[plan]
    state = state_of(poses.plan(name), temperatures)
    effects = BASE if len(temperatures) == 1 else BASE + WARM
    own, more = station(state, PRODUCTION) if influences is None else (influences(state), list(scattered))
    source = sensitivity(model_of(BASE + WARM), state, own, more)
    fit = fit_design(model_of(effects), state, np.eye(state.time.size))
    return state, effects, fit, propagated(fit, source, np.eye(3))


def combined(errors: np.ndarray) -> np.ndarray:
    return 1e6 * np.sqrt(np.sum(errors**2, axis=-1))


def test_repeats_of_a_pose_average_its_repeatability_and_not_what_is_the_same_at_every_visit() -> None:
    angles = np.array([[0.0, 0.0], [180.0, 0.0], [90.0, 0.0], [90.0, 180.0], [90.0, 90.0], [90.0, -90.0]])

    def of(scope: str, repeats: int) -> np.ndarray:
        rng = np.random.default_rng(5)
        coarse = rng.uniform(-0.04, 0.04, (6 * repeats, 2))  # as by the registers of an arm
        read = np.tile(angles, (repeats, 1)) + coarse
        state = posed(read, 30.0, temperature=np.full(len(read), 25.0))
        source = sensitivity(model_of(BASE), state, [], [Scattered("pose", 3e-4, 3e-4, scope)])
        fit = fit_design(model_of(BASE), state, np.eye(len(read)))
        return combined(propagated(fit, source, np.eye(3)).coefficients)

    once = of("pose", 1)
    assert of("pose", 4) == pytest.approx(once / 2.0, rel=0.01, abs=0.5)
    assert of("station", 4) == pytest.approx(once, rel=0.01, abs=0.5)
    assert of("station", 1) == pytest.approx(once, rel=0.01, abs=0.5)


def output(influences, effects, force, temperature) -> np.ndarray:
    """u of the corrected output (3,), µg."""
    nothing = np.zeros(1)
    at = State(np.array([force]), nothing, temperature=np.array([temperature]), outer=nothing, inner=nothing)
    return combined(influences.output_errors(design.local_columns(design.split(effects)[0], at, {}))[0])


WHOLE = {  # bias x, y, z µg; scale ppm; Kxy, Kxz, Kyz, Kyx, Kzx, Kzy µrad
    "six": ([42.459, 31.754, 90.108], [128.841] * 3, [522.351, 503.587, 516.188, 522.351, 501.248, 501.248]),
    "twelve": ([27.170, 27.170, 101.045], [133.838, 133.838, 138.969], [524.476, 500.104, 500.104, 524.476, 500.156, 500.156]),
    "fib": ([26.135, 26.469, 99.170], [132.388, 132.259, 135.399], [523.586, 500.181, 500.118, 524.020, 500.084, 500.085]),
}  # fmt: skip
WARMED = {
    "twelve": [0.3548, 0.3548, 0.3925, 0.9646],
    "fib": [0.2335, 0.2313, 0.2479, 0.7541],
}  # temperature coefficients
OUTPUTS = {
    "six": [((0, 0, 1), 25.0, 2, 165.890)],
    "twelve": [((1, 0, 0), 60.0, 0, 159.066), ((0, 0, 1), 25.0, 2, 179.785)],
    "fib": [((0, 0, 1), 25.0, 2, 175.976), *(((0.6, 0, -0.8), -10.0, a, u) for a, u in enumerate((411.188, 510.253, 330.380)))],
}  # fmt: skip


@pytest.mark.parametrize("plan", PLANS)
def test_the_whole_budget_of_a_workshop_station(plan: str) -> None:
    _, effects, _, influences = through(plan)
    u = combined(influences.coefficients)
    bias, scale, misalignment = WHOLE[plan]
    np.testing.assert_allclose(u[:, 0], bias, rtol=2e-5)
    np.testing.assert_allclose(u[:, 1], scale, rtol=2e-5)
    np.testing.assert_allclose(u[:, 2:4].ravel(), misalignment, rtol=2e-5)
    if plan in WARMED:
        np.testing.assert_allclose([*u[:, 4], u[0, 6]], WARMED[plan], atol=6e-5)
    for force, temperature, axis, expected in OUTPUTS[plan]:
        assert output(influences, effects, force, temperature)[axis] == pytest.approx(expected, rel=2e-5)


def test_what_rules_the_bias_of_z_and_the_visible_shares() -> None:
    _, _, fit, influences = through("fib")
    names, errors = np.array(influences.source.contributions), 1e6 * influences.coefficients[2, 0]
    of_bias = {name: 100.0 * np.sum(errors[names == name] ** 2) / np.sum(errors**2) for name in set(names.tolist())}
    expected = {"level": 63.1, "outer_offset": 22.7, "harmonics": 9.7}
    expected |= {"thermometer_offset": 2.3, "gradient": 1.0, "pose": 0.7}
    assert {name: of_bias[name] for name in expected} == pytest.approx(expected, abs=0.06)
    shares = fit.visible_share(influences.source.changes)
    for name in ("gravity", "thermometer_offset", "thermometer_slope", "supply", "gain"):
        assert shares[names == name].max() < 1e-6, name
    assert shares[names == "inner_offset"][0] == pytest.approx(0.006, abs=0.001)
    assert shares[names == "level"] == pytest.approx([0.26, 0.61], abs=0.01)
    assert shares[names == "orthogonality"][0] == pytest.approx(0.995, abs=0.001)


def moved(plan: str, errors) -> np.ndarray:
    """Coefficients (3, p) per unit of an influence, response 1 and no temperature coefficients but the plan's."""
    return through(plan, lambda state: [InputQuantity("one", errors(state), 1.0)])[3].coefficients[..., 0]


MOVED = [
    ("six", Errors(gravity=1.0), {(0, 1): 1.0, (1, 1): 1.0, (2, 1): 1.0}),
    ("six", Errors(level=(1.0, 0.0)), {(0, 2): 1.0, (1, 3): -1.0, (0, 0): 1 / 3}),
    ("six", Errors(level=(0.0, 1.0)), {(2, 0): -2 / 3, (1, 2): 1.0}),
    ("twelve", Errors(level=(1.0, 0.0)), {(0, 2): (1 + math.sqrt(2)) / 2, (1, 3): -(1 + math.sqrt(2)) / 2}),
    ("twelve", Errors(level=(0.0, 1.0)), {(2, 0): -(1 + math.sqrt(2)) / 3}),
    ("fib", Errors(level=(0.0, 1.0)), {(2, 0): -0.7875}),
    ("six", Errors(orthogonality=1.0), {(0, 3): -1.0}),
    ("six", Errors(inner=1.0), {(0, 2): 1.0, (1, 3): -1.0}),
    ("fib", Errors(outer=1.0), {(2, 0): -0.7875}),
    ("six", Errors(temperature=1.0), {(0, 0): -50e-6, (0, 1): -200e-6}),
    ("twelve", Errors(temperature=1.0), {(0, 0): -50e-6, (0, 1): -200e-6}),
]


@each(MOVED)
def test_a_single_influence_moves_the_coefficients_by_its_closed_form(row) -> None:
    plan, errors, expected = row
    got = moved(plan, lambda _state: errors)
    for where, value in expected.items():
        assert got[where] == pytest.approx(value, rel=2e-3, abs=2e-6)


def test_the_second_outer_sine_does_nothing_on_six_faces_and_moves_scales_on_twelve() -> None:
    def wave(state):
        return Errors(outer=harmonic(state.outer, 2, "sin"))

    assert np.max(np.abs(moved("six", wave))) < 1e-9
    np.testing.assert_allclose(moved("twelve", wave)[:, 1], [0.5, 0.5, -1.0], atol=1e-3)


SHOWN = [  # influence, size, error of the worst axis shown and true, of the norm shown and true, µg
    ("g 500 ppm", lambda s: Errors(gravity=1.0), 500e-6, 0, 296, 0, 503),
    ("g 30 ppm", lambda s: Errors(gravity=1.0), 30e-6, 0, 17.7, 0, 30),
    ("thermometer 1 K", lambda s: Errors(temperature=1.0), 1.0, 0, 130, 0, 276),
    ("level 1", lambda s: Errors(level=(1.0, 0.0)), 300e-6, 53, 200, 12, 12),
    ("level 2", lambda s: Errors(level=(0.0, 1.0)), 300e-6, 150, 236, 204, 204),
    ("outer .01°", lambda s: Errors(outer=1.0), math.radians(0.01), 87, 138, 119, 119),
    ("inner .01°", lambda s: Errors(inner=1.0), math.radians(0.01), 0.6, 101, 0, 0),
    ("supply 100 ppm", lambda s: Errors(gain=1.0), 100e-6, 0, 59, 0, 101),
]


@each(SHOWN)
def test_what_the_stations_own_verification_shows_of_an_error(row) -> None:
    name, errors, size, shown, true, norm_shown, norm_true = row
    _, effects, _, influences = through("fib", lambda state: [InputQuantity(name, errors(state), size)])
    at = state_of(np.array(VERIFICATION), PLANS["fib"][1])
    own = sensitivity(model_of(effects), at, [InputQuantity(name, errors(at), size)])
    columns_ = design.local_columns(design.split(effects)[0], at, {})
    for errors_, of_axis, of_norm in (
        (influences.output_errors(columns_), true, norm_true),
        (influences.shown_errors(columns_, own.changes), shown, norm_shown),
    ):
        worst = 1e6 * np.max(np.sqrt(np.mean(errors_[..., 0] ** 2, axis=0)))
        assert worst == pytest.approx(of_axis, abs=max(0.6, 0.006 * of_axis))
        of_all = 1e6 * np.max(np.abs(norm_errors(errors_, at.force)))
        assert of_all == pytest.approx(of_norm, abs=max(0.6, 0.006 * of_norm))


def test_a_rotation_of_the_whole_unit_is_no_error_in_its_own_frame() -> None:
    seats = [InputQuantity("seat", Errors(seat=unit(k)), 1e-3) for k in range(3)]
    _, effects, _, influences = through("fib", lambda _: seats)
    at = state_of(np.array(VERIFICATION), (25.0,))
    columns_ = design.local_columns(design.split(effects)[0], at, {})
    fixture, own = (influences.user_errors(columns_, at.force, intrinsic=flag) for flag in (False, True))
    assert 1e6 * np.sqrt(np.mean(np.sum(fixture**2, axis=-1))) > 500.0
    assert 1e6 * np.max(np.abs(own)) < 2.0


@pytest.mark.parametrize(("plan", "trials"), mostly_slow([("six", 3300), ("fib", 3300)], ("fib", 3300)))
def test_a_monte_carlo_of_an_independent_station_agrees_to_5_percent(plan: str, trials: int) -> None:
    """JCGM 101 with a forward model and a fit of its own; two standard errors of a deviation are 2.5 %."""
    name, temperatures = PLANS[plan]
    state, _, _, influences = through(plan)
    rng = np.random.default_rng(20261122)
    outer, inner = np.radians(np.tile(poses.plan(name), (len(temperatures), 1))).T
    soak = np.repeat(np.arange(len(temperatures)), len(poses.plan(name)))
    force, read, warm = nominal_force(outer, inner), state.temperature, len(temperatures) > 1
    maps = [np.linalg.pinv(columns(force, read, axis, temperature=warm)) for axis in range(3)]
    got = np.empty((trials, 3, 8 if warm else 4))
    for trial in range(trials):
        out = outputs(outer, inner, read, soak, draws(rng, PRODUCTION, len(temperatures), outer.size))
        got[trial] = [maps[axis] @ out[:, axis] for axis in range(3)]
    drawn = draws(rng, PRODUCTION, len(temperatures), outer.size)
    quiet = outputs(outer, inner, read, soak, {name: 0.0 * np.asarray(value) for name, value in drawn.items()})
    np.testing.assert_allclose(fitted(force, read, quiet, temperature=warm), got.mean(axis=0), atol=5e-5)
    ratio = np.std(got, axis=0, ddof=1) / np.sqrt(np.sum(influences.coefficients**2, axis=-1))
    assert np.max(np.abs(ratio - 1.0)) < 0.05
    own = influences.covariance()
    spread = np.sqrt(np.diagonal(own))
    sampled = np.corrcoef(got.reshape(trials, -1).T)
    assert np.max(np.abs(sampled - own / np.outer(spread, spread))) < 0.07


RISKS = [  # mean, process, u, tolerance, acceptance, PFA, PFR, accepted
    (0, 0.5, 0.25, 1, 1, 0.01238875, 0.04052676, 0.92636173),
    (0, 0.5, 0.25, 1, 0.5, 0.00033509, 0.32592819, 0.62890663),
    (0, 0.5, 0.125, 1, 0.75, 0.00019461, 0.10030445, 0.85438990),
    (0, 0.6, 0.1, 1, 1, 0.01114350, 0.01574109, 0.89982171),
    (0.2, 0.4, 0.15, 1, 1, 0.00562298, 0.01456562, 0.96695733),
    (0.2, 0.4, 0.15, 1, 0.7, 0.00014525, 0.11453296, 0.86151226),
    (0, 1, 0.5, 1, 1, 0.06902131, 0.12280417, 0.62890663),
    (0, 0.12, 0.04, 0.2, 0.2, 0.01894221, 0.03720780, 0.88615370),
    (0, 0.12, 0.04, 0.2, 0.12, 0.00046863, 0.24766964, 0.65721829),
    (0, 400, 100, 1000, 800, 0.00006094, 0.03998667, 0.94765494),
    (0, 400, 275, 1000, 1000, 0.00418334, 0.03115253, 0.96061148),
    (0, 400, 275, 1000, 450, 0.00012501, 0.34160772, 0.64609795),
    (-0.3, 0.3, 0.3, 1, 0.4, 0.00011802, 0.44660728, 0.54368807),
    (300, 150, 50, 1000, 1000, 0.00000047, 0.00000371, 0.99999523),
]


@each(RISKS)
def test_global_risks_are_those_of_suncal(row) -> None:
    mean, process, u, tolerance, accept, *risks = row
    risk = lot_risk(mean, process, u, 0.0, (-tolerance, tolerance), (-accept, accept))
    assert (risk.pfa, risk.pfr, risk.accepted) == pytest.approx(risks, abs=6e-9)


def process_for(share: float) -> float:
    """Standard deviation of a centred production of which so large a share lies within ± 1."""
    return 1.0 / NormalDist().inv_cdf(0.5 * (1.0 + share))


def test_suncals_risks_by_share_in_tolerance_and_ratio() -> None:
    risk = lot_risk(0.0, process_for(0.95), 0.125, 0.0, (-1.0, 1.0), (-1.0, 1.0))
    assert (risk.pfa, risk.pfr) == pytest.approx((0.00858266, 0.01553651), abs=6e-9)
    table = {1.0: (0.044473, 0.032509, 0.018012, 0.004064), 2.0: (0.029522, 0.022638, 0.013373, 0.003312)}
    for ratio, expected in table.items():
        for share, pfa in zip((0.85, 0.90, 0.95, 0.99), expected, strict=True):
            got = lot_risk(0.0, process_for(share), 0.5 / ratio, 0.0, (-1.0, 1.0), (-1.0, 1.0)).pfa
            assert got == pytest.approx(pfa, abs=6e-7)
    ratios, shares = (1.0, 1.0, 1.5, 2.0, 3.0), (0.85, 0.90, 0.85, 0.90, 0.85)
    limits = (0.686236, 0.792397, 0.847477, 0.973153, 0.987788)  # of acceptance, for two per cent
    for ratio, share, limit in zip(ratios, shares, limits, strict=True):
        risk = lot_risk(0.0, process_for(share), 0.5 / ratio, 0.0, (-1.0, 1.0), (-limit, limit))
        assert risk.pfa == pytest.approx(0.02, abs=1e-6)


def test_specific_risks_and_the_guard_band_of_two_percent() -> None:
    rows = ((485, 275, 1000), (160, 25, 200), (0, 99, 50), (42, 99, 50), (1.0, 0.1, 1.0), (0.8, 0.1, 1.0))
    risks = [outside(value, u, limit) for value, u, limit in rows]
    assert risks == pytest.approx([0.030553, 0.054799, 0.613523, 0.644166, 0.5, 0.022750], abs=6e-7)


def effective_of(u, dof) -> float:
    return float(effective_degrees(np.array([u]), np.array([dof]))[0])


def test_gum_h1() -> None:
    """End gauge: u_c 32 nm, ν_eff 16, k(99 %) 2.92, U 93 nm (JCGM 100, H.1.6)."""
    u, dof = [25.0, 5.8, 3.9, 6.7, 2.9, 16.6], [18, 24, 5, 8, 50, 2]
    whole, effective = math.hypot(*u), effective_of(u, dof)
    factor = float(coverage_factors(np.asarray(effective), 0.99))
    assert (whole, effective) == (pytest.approx(31.7, abs=0.05), pytest.approx(16.75, abs=0.01))
    assert (factor, factor * whole) == (pytest.approx(2.92, abs=0.005), pytest.approx(92.5, abs=0.1))


EFFECTIVE = [  # standard uncertainties, degrees of freedom; effective ones, k and U
    ((50, 40), (6, math.inf), 16.1376, 2.1689, 138.8801),
    ((50, 40), (2, math.inf), 5.3792, 2.6487, 169.5966),
    ((50, 40), (24, math.inf), 64.5502, 2.0398, 130.6125),
    ((50, 40, 30), (6, 8, math.inf), 18.3599, 2.1489, 151.9468),
]


@each(EFFECTIVE)
def test_effective_degrees_of_freedom(row) -> None:
    u, dof, effective, k, expanded = row
    got = effective_of(u, dof)
    factor = float(coverage_factors(np.asarray(got)))
    assert got == pytest.approx(effective, abs=5e-3)
    assert factor == pytest.approx(k, abs=6e-5)
    assert factor * math.hypot(*u) == pytest.approx(expanded, abs=6e-3)


ROUNDED = [
    (485.37, 549.6, ("490", "550")), (0.99961234, 2.37e-5, ("0.999612", "0.000024")), (1234.5, 0.996, ("1234.5", "1.0")),
    (-0.0049, 0.0104, ("-0.005", "0.010")), (42, 9.95, ("42", "10")), (12.345, 0.105, ("12.35", "0.11")),
    (98765.4, 1234, ("98800", "1200")), (10.05762, 0.027, ("10.058", "0.027")), (-0.0004, 0.5, ("0.00", "0.50")),
]  # fmt: skip


@each(ROUNDED)
def test_rounding(row: tuple[float, float, tuple[str, str]]) -> None:
    assert rounded(*row[:2]) == row[2]


FLICKER = [
    (10, 10, 0, 0.939437), (9000, 10, 0, 1.576869), (9000, 10, 86400, 2.142937), (9000, 10, YEAR_S, 2.883853),
    (18000, 10, YEAR_S, 2.845356), (180, 10, YEAR_S, 3.092254), (18000, 3600, YEAR_S, 2.494491),
]  # fmt: skip


@each(FLICKER)
def test_flicker_to_the_due_date(row: tuple[float, float, float, float]) -> None:
    assert flicker_later(Windows(*row[:3])) == pytest.approx(row[3], abs=1e-6)


@each([(300, 2.5, 441, 865, 300, 916), (150, 4, 228, 429, 200, 473), (30, 5, 46, 85, 50, 99)])
def test_devices_over_twelve_months(row) -> None:
    b, run_h, in_run, year, switch_on, whole = row
    within, later = (b * of(Windows(3600.0 * run_h, 10.0, YEAR_S)) for of in (flicker_within, flicker_later))
    assert (within, later, math.hypot(later, switch_on)) == pytest.approx((in_run, year, whole), abs=0.6)


def test_flicker_that_ends_at_a_time_constant_is_that_of_ornstein_uhlenbeck_processes() -> None:
    """Against the sum of processes itself: means of many simulated records, far apart."""
    rng, slowest = np.random.default_rng(5), 400.0
    taus = slowest * 2.0 ** -np.arange(12)
    step, records, a, u = 2.0, 3000, 200, 10
    keep, size, means = np.exp(-step / taus), np.sqrt(np.log(2.0) / np.pi), []
    for count in (a, u):  # the second long after the first
        x, mean = size * rng.standard_normal((records, taus.size)), np.zeros(records)
        for _ in range(count):
            x = keep * x + size * np.sqrt(1 - keep**2) * rng.standard_normal(x.shape)
            mean += x.sum(axis=1) / count
        means.append(mean)
    expected = flicker_later(Windows(a * step, u * step, 1e7), slowest)
    assert np.std(means[1] - means[0]) == pytest.approx(expected, rel=0.06)


def test_walks_and_ageing() -> None:
    assert period.walk_later(Windows(9000.0, 10.0, YEAR_S)) == pytest.approx(5618.0, abs=1.0)
    assert period.logarithmic(50.0, YEAR_S) == pytest.approx(128.0, abs=0.2)
    assert period.bounded_walk(1200.0, YEAR_S, YEAR_S) == pytest.approx(1349.0, abs=1.0)


@pytest.mark.parametrize(("latitude", "gravity"), [(0, 9.7803267715), (45, 9.8061992025), (90, 9.8321863685)])
def test_gravity_by_the_formula_of_1980_and_at_published_sites(latitude: float, gravity: float) -> None:
    assert formula_gravity(latitude) == pytest.approx(gravity, abs=2e-10)
    assert formula_gravity(latitude, 1.0) / gravity - 1.0 == pytest.approx(-0.315e-6, abs=2e-9)
    for north, height, published in ((48.8292, 66.0, 9.809257012), (39.13, 137.0, 9.801018), (52.295, 80.0, 9.812394)):
        assert abs(published / formula_gravity(north, height) - 1.0) < 3 * 60e-6
