"""The curves that physics which the catalogue lacks is compared with."""

from itertools import product

import numpy as np
import pytest
from each import each
from made_worlds import BASE, Noise, World, make, run_of

from inertial import effects
from inertial.criticism.curves import fit_curves
from inertial.criticism.drivers import across, curve, forces_along
from inertial.criticism.examination import ExaminedRun
from inertial.criticism.unknown import curve_in_noise, suspects, wide_suspects
from inertial.estimation.comparison import estimate
from inertial.estimation.likelihood import shared_noise
from inertial.estimation.model import Model
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

SEED = 6_400_000


def test_a_curve_across_the_axes_has_the_shape_of_the_truth() -> None:
    world = World(hidden=(("axes_warm_up", 20.0),))
    run = run_of(world, SEED + 40)
    model = run.model()
    time = run.lot.state.time
    suspect = next(s for s in wide_suspects(model.problem) if s.name == "time_s" and s.ways == 2)
    (fit,) = fit_curves(model, [suspect])
    # two sizes for each block; of the shape's columns those that the times of the soaks part
    assert 2 <= fit.rank - 2 * model.problem.blocks + 1 <= curve(time, 6).shape[-1]
    (bias_only,) = fit_curves(model, [next(s for s in wide_suspects(model.problem) if s.ways == 1)])
    assert fit.cost < bias_only.cost - 1000.0
    # with the truth itself as the only column the cost is the same, within the price of the shape
    course = np.exp(-time / 1500.0)[..., None]
    exact = model.with_curves(across(forces_along(model.problem), course))
    assert fit.model.space.rss == pytest.approx(exact.space.rss, rel=0.1)


def test_columns_across_the_axes_are_products_of_forces() -> None:
    problem = run_of(World(units=2), SEED + 50).model().problem
    state = problem.lot.state
    values = np.broadcast_to(state.time, (2, problem.n))
    columns = across(forces_along(problem), values[..., None])
    for unit, axis, way in product(range(2), range(3), (1, 2)):
        other = np.broadcast_to(state.along((axis + way) % 3), (2, problem.n))
        np.testing.assert_allclose(columns[3 * unit + axis][:, way - 1], (values * other)[unit], rtol=1e-12)


@each([1500.0, 1780.0, 1800.0, 1830.0, 1860.0, 3000.0])
def test_an_effect_that_died_away_long_ago_leaves_the_range_of_numbers_quietly(shift: float) -> None:
    made = make(World(units=4), SEED + 80)
    dwells = made.dwells.assign(since_power_s=made.dwells["since_power_s"] + shift)
    model = ExaminedRun(lot_of(measured(dwells, made.history), square=False), BASE).model()
    # its columns are of 1e-140 g and less, the squares of some of them are no numbers; warnings are errors here
    fit = estimate(model.with_term(Term(effects.get("warm_up"), (("tau", 10.0),))))
    before = estimate(model)
    np.testing.assert_allclose(fit.local[:, 1], before.local[:, 1], rtol=1e-5)


def lot_with(common: np.ndarray | float, own: np.ndarray | float = 0.0) -> Model:
    """A model beside a lot with something, µg, (n,) that all units and axes share, or (4, n, 3) of their own."""
    made = make(World(units=4), SEED + 90)
    order = made.dwells.sort_values(["unit", "dwell"]).index
    added = np.broadcast_to(1e-6 * (np.ravel(common)[None, :, None] + own), (4, len(order) // 4, 3)).reshape(-1, 3)
    dwells = made.dwells.copy()
    dwells.loc[order, ["out_x", "out_y", "out_z"]] += added
    return ExaminedRun(lot_of(measured(dwells, made.history), square=False), BASE).model()


def test_what_units_share_is_no_random_walk_walks_are_no_course_and_noise_of_single_dwells_follows_no_driver() -> None:
    n = len(make(World(units=4), SEED + 90).dwells) // 4
    rng = np.random.default_rng(SEED + 91)
    day = 80.0 * np.sin(np.linspace(0.0, 6.0 * np.pi, n))
    model = lot_with(day)
    fit = curve_in_noise(model, suspects(model.problem))
    assert fit is not None
    assert fit.driver.name in {"time_s", "since_power_s"}
    floor = 1e-6 * make(World(units=4), SEED + 90).floor_ug
    assert fit.model.floor() == pytest.approx(floor, rel=0.15)
    assert model.floor() > 1.5 * floor
    walks = 40.0 / np.sqrt(n) * np.cumsum(rng.standard_normal((4, n, 3)), axis=1)
    model = lot_with(0.0, walks)
    assert curve_in_noise(model, suspects(model.problem)) is None
    model = lot_with(60.0 * np.random.default_rng(SEED + 92).standard_normal(n))
    assert shared_noise(model) > 3.0
    assert curve_in_noise(model, suspects(model.problem)) is None


def test_a_walk_over_the_pauses_between_soaks_is_no_oscillation() -> None:
    """What a walk puts between soaks lies in the bias of a block, which a model of less walk would not have to explain."""
    made = make(World(units=12, noise=Noise(white=10.0, flicker=0.0)), SEED + 95)
    time = made.dwells["time_s"].to_numpy().reshape(12, -1)
    time = time + 40_000.0 * np.cumsum(np.diff(time, prepend=time[:, :1]) > 600.0, axis=1)
    steps = np.random.default_rng(0).standard_normal((3, *time.shape)) * np.sqrt(np.diff(time, prepend=time[:, :1]))
    dwells = made.dwells.assign(time_s=time.ravel()).drop(columns="since_power_s")
    dwells[["out_x", "out_y", "out_z"]] += 5e-8 * np.cumsum(steps, axis=2).reshape(3, -1).T
    model = ExaminedRun(lot_of(measured(dwells), square=False), BASE).model()
    assert curve_in_noise(model, suspects(model.problem)) is None
