"""Sizes of levels and their intervals, on scores whose sizes and noise are drawn here."""

from dataclasses import dataclass

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial.discovery.driver_sums import LotStack
from inertial.discovery.evidence import MEAN, ScoredLot
from inertial.discovery.naming import Name, Pool
from inertial.discovery.scores import Products

UNITS, AXES = 6, 3


@dataclass
class Drawn:
    """How scores are drawn: coefficients have the noise of one unit in a lot.

    beyond : standard deviation of the units' noise over the stated one, by axis · common : of what a lot's units share
    lasting : number of lots of a station that what they share lasts
    """

    beyond: tuple[float, float, float] = (1.0, 1.0, 1.0)
    common: float = 0.0
    lasting: int = 1

    def lots(self, rng: np.random.Generator, sizes: np.ndarray, levels: np.ndarray) -> list[ScoredLot]:
        """Lots of three stations with sizes (levels, axes) of units whose levels are given, (lots, units)."""
        shared = rng.standard_normal((3, len(levels), AXES))[:, np.arange(len(levels)) // self.lasting]
        out: list[ScoredLot] = []
        for number, of_units in enumerate(levels):
            noise = np.array(self.beyond) * rng.standard_normal((UNITS, AXES))
            score = sizes[of_units] + noise + self.common * shared[number % 3, number // 3]
            own = np.ones((UNITS, AXES))
            batch = {"batch": tuple(f"B{k}" for k in of_units)}
            serials = tuple(f"{number}-{k}" for k in range(UNITS))
            out.append(ScoredLot(f"{number}", f"s{number % 3}", 0.0, serials, score, own, own.sum(axis=0), batch))
        return out


def pool() -> Pool:
    """One column, which is measured in units of its size."""
    alone = np.ones((AXES, 1, 1))
    return Pool(Products((("third_order", 0),), (), np.eye(AXES), alone, np.ones(AXES)))


def named(lots: list[ScoredLot], driver: str) -> Name:
    (name,), _ = pool()._sized([Name(("third_order",), (driver,), 100.0)], LotStack.of(lots))
    return name


def test_batches_that_meet_only_their_neighbours_have_their_sizes() -> None:
    """Each lot has units of two batches; the sizes grow from batch to batch, of which a lot shows a step."""
    rng = np.random.default_rng(5)
    sizes = np.repeat(np.linspace(-3.0, 3.0, 12)[:, None], AXES, axis=1)
    levels = np.array([[k // 20 + (u > k % 6) for u in range(UNITS)] for k in range(220)])
    name = named(Drawn(common=2.0).lots(rng, sizes, levels), "batch")
    count = np.bincount(levels.ravel())
    about = sizes - np.average(sizes, axis=0, weights=count)
    order = [int(label[1:]) for label in name.labels]
    slope = np.polyfit(about[order].ravel(), name.sizes.ravel(), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)


WORLDS = {
    "as stated": Drawn(),
    "one axis louder": Drawn(beyond=(1.0, 1.0, 2.0)),
    "common to a lot": Drawn(common=2.0),
    "common, and lasting": Drawn(common=1.0, lasting=3),
}


@pytest.mark.parametrize("driver", ["batch", MEAN])
@pytest.mark.parametrize("world", mostly_slow(list(WORLDS), "one axis louder", "common, and lasting"))
def test_intervals_hold_the_size_of_which_the_lots_are_drawn(world: str, driver: str) -> None:
    """The pull, estimate less truth over the stated error, has an rms of one in 40 archives."""
    pulls: list[float] = []
    for seed in range(40):
        rng = np.random.default_rng([seed, 31])
        sizes = rng.standard_normal((1 if driver == MEAN else 8, AXES))
        levels = rng.integers(0, len(sizes), (120, UNITS))
        lots = WORLDS[world].lots(rng, sizes, levels)
        of_units = sizes[levels].reshape(-1, AXES)
        true = np.mean((of_units - (0.0 if driver == MEAN else of_units.mean(axis=0))) ** 2)
        estimate, deviation = named(lots, driver).square
        pulls.append(float((estimate - true) / deviation))
    assert np.mean(pulls) == pytest.approx(0.0, abs=0.4)
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.3)


def test_noise_that_a_unit_estimates_beside_the_effect_takes_nothing_of_it() -> None:
    """A unit's information is that by what 20 values leave, in which its effect and the error along it are."""
    rng = np.random.default_rng(8)
    count, lots = 20, list[ScoredLot]()
    column = rng.standard_normal(count)
    column /= np.sqrt(column @ column)
    sizes = 3.0 * rng.standard_normal((4, AXES))
    for number in range(400):
        levels = rng.integers(0, 4, UNITS)
        values = sizes[levels][..., None] * column + rng.standard_normal((UNITS, AXES, count))
        own = count / (values**2).sum(axis=2)
        supplier = {"supplier": tuple(f"S{k}" for k in levels)}
        score, serials = own * (values @ column), tuple(f"{number}-{k}" for k in range(UNITS))
        lots.append(ScoredLot(f"{number}", f"s{number % 3}", 0.0, serials, score, own, own.sum(axis=0), supplier))
    name = named(lots, "supplier")
    at = [int(label[1:]) for label in name.labels]
    true = sizes[at] - np.average(sizes[at], axis=0, weights=name.weights)
    assert np.sum(name.sizes * true) / np.sum(true**2) == pytest.approx(1.0, abs=0.02)
