"""Names of what an archive holds, on lots that are scored from simulated dwells."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from long_suites import mostly_slow

from benchmarks.discovery.archives import ArchiveMaker, Hidden, Result, Setting
from benchmarks.discovery.lots import FLOOR_UG, WORLDS, bank
from inertial.discovery.driver_sums import LotStack, gathered
from inertial.discovery.evidence import ScoredLot
from inertial.discovery.naming import Pool

NEEDED = 11.5


@cache
def maker() -> ArchiveMaker:
    """Archives of lots whose table rests 20 µrad off its targets."""
    return ArchiveMaker(bank(WORLDS[1], 10, 77), WORLDS[1])


def pool() -> Pool:
    return Pool(maker().products)


HIDDEN = [
    ("third_order", "wafer"),
    ("cross_coupling", "slot"),
    ("second_order", "radius"),
    ("scale_asymmetry", "mean"),
    ("creep_after_move", "slot"),
]


@cache
def archive(effect: str, driver: str) -> Result:
    """Forty lots with an effect of 0.3 of the noise of a dwell."""
    return maker().archive(31, 40, Hidden(effect, driver, 0.3), Setting(), keep=True)


@pytest.mark.parametrize(("effect", "driver"), mostly_slow(HIDDEN, ("third_order", "wafer")))
def test_effect_and_driver_are_named_and_nothing_else(effect: str, driver: str) -> None:
    result = archive(effect, driver)
    (name,), unnamed = pool().names(result.lots, result.alarms, NEEDED)
    assert unnamed == []
    assert effect in name.effects
    assert len(name.effects) <= 4
    assert name.drivers[0] == driver
    # of unit rms over the levels; the time constant of a creep is unknown
    if driver in {"slot", "radius"} and effect != "creep_after_move":
        assert name.size()[0] == pytest.approx(0.3 * FLOOR_UG * 1e-6, rel=0.06)
    factor, error, able = pool().confirmed(result.lots[:20], result.lots[20:], driver, effect)
    assert able == 20
    assert factor == pytest.approx(1.0, abs=max(5.0 * error, 0.2))
    assert float(np.mean(pool().carried(result.lots, driver, effect) > 0.0)) > 0.6


def test_what_had_no_alarm_is_not_named() -> None:
    lots = archive("third_order", "wafer").lots
    assert pool().names(lots, {("wafer", "third_order")}, NEEDED)[0]
    assert pool().names(lots, {("wafer", "scale_temperature_quadratic")}, NEEDED)[0] == []


def test_what_all_stations_have_alike_is_no_difference_of_stations() -> None:
    lots = archive("scale_asymmetry", "mean").lots
    assert [name.drivers for name in pool().names(lots, {("mean", "scale_asymmetry")}, NEEDED)[0]] == [("mean",)]
    assert pool().names(lots, {("station", "scale_asymmetry")}, NEEDED) == ([], [])


def supplied(result: Result) -> list[ScoredLot]:
    """The units of every other slot are of one supplier."""
    return [replace(lot, levels={"supplier": ("north", "south") * 4}) for lot in result.lots]


def test_two_levels_have_the_size_about_their_mean_and_leave_nothing() -> None:
    """Each lot has four units of either supplier: the difference of one from the mean of the lot is half of theirs."""
    result = maker().archive(31, 40, Hidden("cross_coupling", "slot", 0.1), Setting(), keep=True)
    (name, *_), _ = pool().names(supplied(result), {("supplier", "cross_coupling")}, NEEDED)
    hidden = 1e-6 * FLOOR_UG * np.mean(result.hidden, axis=0)
    true = hidden[0::2].mean(axis=0) - hidden.mean(axis=0)
    assert np.all(name.errors[0] < 0.25e-6)
    assert np.all(np.abs(np.abs(name.sizes[0]) - np.abs(true)) < 3.0 * name.errors[0])
    lots = supplied(archive("cross_coupling", "slot"))
    (name, *_), _ = pool().names(lots, {("supplier", "cross_coupling")}, NEEDED)
    left = pool()._subtracted(LotStack.of(lots), "supplier", "cross_coupling")
    assert pool().score(gathered(left, ["supplier"])["supplier"], "cross_coupling") < 0.01 * name.score


def test_an_effect_of_units_measured_again_is_named_by_them() -> None:
    """The units of a wafer in forty lots are taken for one and the same."""

    def again(lot: ScoredLot) -> ScoredLot:
        wafers = lot.levels["wafer"]
        return replace(lot, units=tuple(f"{w}-{wafers[:k].count(w)}" for k, w in enumerate(wafers)))

    lots = [again(lot) for lot in archive("third_order", "wafer").lots]
    (name, *_), unnamed = pool().names(lots, {("unit", "third_order")}, NEEDED)
    assert ("third_order" in name.effects, name.drivers, unnamed) == (True, ("unit",), [])
    assert pool().confirmed(lots[:20], lots[20:], "unit", "third_order")[0] == pytest.approx(1.0, abs=0.2)


@pytest.mark.slow
def test_an_effect_in_the_model_of_every_lot_leaves_nothing_of_it() -> None:
    result = archive("third_order", "wafer")
    assert result.alarms
    own, count = pool(), len(maker().products.columns)
    at = own.places("third_order")[0] + count * np.arange(3)
    near = own.places("odd_quadratic")[0] + count * np.arange(3)
    changed = [own.with_effect(lot, "third_order") for lot in result.lots]
    assert all((lot.score[:, at] == 0.0).all() and (lot.information[at] == 0.0).all() for lot in changed)

    def misfit(lots: list, places: np.ndarray) -> float:
        return float(np.mean([lot.score[:, places] ** 2 / np.maximum(lot.own[:, places], 1e-300) for lot in lots]))

    # a neighbour of 0.98 keeps a twentieth of its information, and is noise again
    assert misfit(changed, near) < 0.7 * misfit(result.lots, near)
