"""Faults of data and errors of handling: tails of the noise, coarse digits, exchanged units."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow
from made_worlds import BASE, HIDDEN, NULLS, Noise, World, lot_in, make
from scipy import integrate, stats

from inertial.criticism.examination import ExaminedRun, examined
from inertial.data_errors import tails
from inertial.data_errors.bad_dwells import _Deletion, any_of_all
from inertial.data_errors.handling.units_swapped import UnitsSwapped
from inertial.data_errors.removed_dwells import BadDwell
from inertial.data_errors.tails import with_tails
from inertial.decisions import BAD_DWELL
from inertial.estimation.alternative import common, pose_errors
from inertial.estimation.likelihood import scatter_of_poses
from pipelines.tables.sound_lot import sound_lot

GATE = 5.4
"""Standard deviations from which a dwell of a small lot is left out."""


def drawn(share: float, dwells: int, rng: np.random.Generator) -> np.ndarray:
    """Dwells (dwells, 3) of variance one, a share of it t of three degrees of freedom."""
    heavy = np.sqrt(share / 3.0) * rng.standard_t(3, (dwells, 3))
    return heavy + np.sqrt(1.0 - share) * rng.standard_normal((dwells, 3))


def named(values: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Dwells that are named of those left out by their length."""
    length = np.linalg.norm(values, axis=1)
    gone = [int(k) for k in np.argsort(length)[::-1][: max(2, len(values) // 50)] if length[k] > GATE]
    if not gone:
        return []
    monkeypatch.setattr(tails, "deletion_residuals", lambda model: np.delete(values, gone, axis=0).ravel())
    removed = [BadDwell(0, k, 1e-5 * values[k], np.abs(values[k])) for k in gone]
    return [d.dwell for d in with_tails(None, removed) if not d.tail]  # type: ignore[arg-type]


@pytest.mark.parametrize("share", mostly_slow([0.1, 0.35, 1.0], 0.35))
@pytest.mark.parametrize("z", [1.0, 3.0, 6.0, 12.0, 30.0])
def test_tables_agree_with_an_integral_of_the_convolution(share, z):
    scale, rest = np.sqrt(share / 3.0), np.sqrt(1.0 - share)
    if share == 1.0:
        expected = 2.0 * stats.t.sf(z / scale, 3)
    else:
        points = np.linspace(-9.0 * rest, 9.0 * rest, 40)
        expected = 2.0 * sum(
            integrate.quad(lambda x: stats.norm.pdf(x, scale=rest) * stats.t.sf((z - x) / scale, 3), a, b)[0]
            for a, b in pairwise(points)
        )
    probability = tails._probability_beyond(tails._SHARES.index(share), np.array([z]))[0]
    # beyond eight standard deviations the normal part is left out, where it adds a few per cent
    assert probability == pytest.approx(expected, rel=0.002 if z < 8.0 else 0.15)


@pytest.mark.parametrize(("share", "dwells"), mostly_slow([(0.35, 72), (0.6, 72), (1.0, 144), (0.6, 576)], (0.6, 72)))
def test_heavy_tails_are_named_in_few_runs(share, dwells, monkeypatch):
    rng = np.random.default_rng([7, dwells, int(100 * share)])
    runs = 80 if dwells < 500 else 30
    hits = sum(bool(named(drawn(share, dwells, rng), monkeypatch)) for _ in range(runs))
    assert hits <= 0.07 * runs


FAR_OFF = [(72, 12.0, 40), (576, 12.0, 20), (576, 7.0, 12)]


@pytest.mark.parametrize(("dwells", "deviations", "runs"), mostly_slow(FAR_OFF, FAR_OFF[0]))
def test_a_dwell_far_off_in_normal_noise_is_named(dwells, deviations, runs, monkeypatch):
    """Of many dwells the drawn is known to have no tails: then seven deviations are far."""
    rng, hits = np.random.default_rng([8, dwells]), 0
    for _ in range(runs):
        values, way = drawn(0.0, dwells, rng), rng.standard_normal(3)
        values[5] += deviations * way / np.linalg.norm(way)
        hits += 5 in named(values, monkeypatch)
    assert hits >= min(0.95 * runs, runs - 1)


def test_deviations_of_units_whose_noise_differs_are_chi_square_with_few_dwells():
    """Twelve dwells leave eight degrees of freedom: squares of Student's t over three axes reach much further."""
    rng = np.random.default_rng(9)
    made = make(World(units=1, soaks=(25.0,), noise=Noise(white=10.0, flicker=0.0)), 6_300_090)
    of_unit = made.dwells[made.dwells["dwell"] < 12]
    lot = lot_in(replace(made, dwells=pd.concat([of_unit.assign(unit=f"U{k}") for k in range(200)])))
    lot.output[...] += 1e-4 * np.exp(rng.normal(0.0, 0.6, (200, 1, 3))) * rng.standard_normal(lot.output.shape)
    model = ExaminedRun(lot, BASE[:3]).model()
    assert np.isfinite(model.noise.prior)
    deviations = _Deletion(model.space, 3).statistic()
    beyond = [np.count_nonzero(deviations > stats.chi2.isf(p, 3)) for p in (0.1, 1e-3)]
    assert beyond[0] == pytest.approx(240, abs=30)
    assert beyond[1] <= 6
    assert np.max(deviations) < stats.chi2.isf(BAD_DWELL / deviations.size, 3)


def test_two_bad_dwells_are_no_tails_of_each_other_and_one_axis_at_six_deviations_is_not_named(monkeypatch):
    values = drawn(0.0, 576, np.random.default_rng(9))
    values[5], values[80] = [20.0, -15.0, 20.0], [0.0, 25.0, -20.0]
    assert sorted(named(values, monkeypatch)) == [5, 80]
    values = drawn(0.0, 72, np.random.default_rng(10))
    values[5] = [6.3, 0.2, -0.4]
    assert named(values, monkeypatch) == []


@pytest.mark.parametrize("seed", mostly_slow(range(6), 0, 1))
def test_scatter_that_follows_the_temperature_is_not_quantised(seed: int) -> None:
    made = make(World(noise=Noise(white=150.0, flicker=10.0)), 5_800_000 + seed)
    dwells = made.dwells.copy()
    rng = np.random.default_rng(seed)
    louder = np.exp((dwells["unit_C"].to_numpy() - 25.0) / 40.0)
    for axis in "xyz":
        sigma = dwells[f"sd_{axis}"].median()
        own = sigma * louder
        extra = np.sqrt(np.maximum(own**2 - sigma**2, 0.0) / dwells["n"])
        dwells[f"out_{axis}"] += extra * rng.standard_normal(len(dwells))
        dwells[f"sd_{axis}"] = own * (1.0 + rng.standard_normal(len(dwells)) / np.sqrt(2.0 * dwells["n"]))
    assert dwells["sd_x"].max() > 3.0 * dwells["sd_x"].min()
    _, faults, _ = sound_lot(dwells, made.history, BASE)
    assert [fault.name for fault in faults] == []


WORLDS = ["B30", "K8", "two_units", "many_units", "third_order_2"]


@pytest.mark.parametrize("world", mostly_slow(WORLDS, "B30", "third_order_2"))
def test_no_pair_is_searched_where_no_units_were_exchanged(world: str) -> None:
    assert UnitsSwapped().locations(lot_in(make((NULLS | HIDDEN)[world], 6_300_020))) == []
    assert not UnitsSwapped().possible(np.array([0.5]))


def test_units_in_each_others_seats_for_a_while_are_found_with_both_ends() -> None:
    lot = lot_in(make(World(units=4), 6_300_040))
    output = lot.output.copy()
    scale = np.ones((4, 3)) if lot.scale is None else lot.scale
    output[[1, 2], 20:44] = (scale[[2, 1], None] / scale[[1, 2], None] * output[[2, 1]])[:, 20:44]
    places = UnitsSwapped().locations(replace(lot, output=output))
    assert {(place["unit"], place["other"]) for place in places} == {(1.0, 2.0)}
    assert (places[0]["dwell"], places[0]["until"]) == (20.0, 44.0)
    settled = UnitsSwapped().settled(replace(lot, output=output), np.ones(1), lambda *_, **__: 0.0, **places[0])
    assert settled is not None
    np.testing.assert_allclose(settled.output, lot.output)


@pytest.mark.parametrize("stated", [False, True])
def test_a_pose_that_is_off_has_two_columns_across_its_force(*, stated: bool) -> None:
    state = lot_in(make(World(units=2), 6_300_050)).state
    state = replace(state, outer=None, inner=None) if stated else state
    columns = pose_errors(state)
    force = common(np.broadcast_to(state.force, (*state.time.shape, 3)))
    assert columns.shape == (*force.shape, 2)
    np.testing.assert_allclose(np.einsum("unik,uni->unk", columns, force), 0.0, atol=1e-12)
    if stated:
        length = np.repeat(np.linalg.norm(force, axis=-1)[..., None], 2, axis=-1)
        np.testing.assert_allclose(np.linalg.norm(columns, axis=-2), length)
        seats = state.force * np.array([[[1.0, 1.0, 1.0]], [[-1.0, 1.0, 1.0]]])
        assert pose_errors(replace(state, force=seats)).shape[-1] == 0  # of their own: a pose is no direction of all


@pytest.mark.parametrize("units", [3, 8])
def test_a_dwell_that_is_off_in_every_unit_in_its_own_way_is_no_noise(units: int) -> None:
    lot = lot_in(make(World(units=units), 61))
    output = lot.output.copy()
    output[:, 30] += 1e-3 * np.random.default_rng(61).standard_normal((units, 3))
    spoilt = replace(lot, output=output)
    run, _ = examined(spoilt, BASE)
    assert {dwell.dwell for dwell in run.removed} == {30}
    assert len(run.removed) >= units - 1
    assert [any_of_all(ExaminedRun(one, BASE).model()) for one in (spoilt, lot)] == [True, False]


def test_a_table_at_rest_within_some_microradians_is_seen_in_stated_forces_as_in_angles() -> None:
    lot = lot_in(make(NULLS["rest20"], 6_300_080))
    stated = replace(lot, state=replace(lot.state, outer=None, inner=None, memory={}))
    scatters = [scatter_of_poses(ExaminedRun(each, BASE).model()) for each in (lot, stated)]
    assert min(scatters) > 1.3
    assert scatters[1] == pytest.approx(scatters[0], rel=0.25)
    assert scatter_of_poses(ExaminedRun(lot_in(make(NULLS["white"], 6_300_080)), BASE).model()) < 1.3
