"""Evidence over lots: silent in noise, one lot cannot speak, what is there is found, a state goes on where it was."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from long_suites import mostly_slow

from benchmarks.discovery.archives import earlier_in
from inertial.discovery.evidence import ALL, INSIDE, SLOPE, Evidence, ScoredLot, restored, stored
from inertial.discovery.running_sums import FIRST, Levels, Scale, Sums

UNITS, COUNT = 6, 9
NEEDED = float(np.log(COUNT * 8 / 0.05))
Change = Callable[[ScoredLot, int], ScoredLot]


def lots(seed: int, number: int, change: Change = lambda lot, _: lot) -> list[ScoredLot]:
    """Lots of unit noise at two stations, with labels that mean nothing."""
    rng = np.random.default_rng(seed)
    out: list[ScoredLot] = []
    for k in range(number):
        own = rng.uniform(0.8, 1.25, (UNITS, COUNT)) * 40.0
        score = np.sqrt(own) * rng.standard_t(4, (UNITS, COUNT))
        lot = ScoredLot(
            run=f"r{k}",
            station=f"s{rng.integers(2)}",
            day=k / 10.0,
            units=tuple(f"u{rng.integers(400)}-{j}" for j in range(UNITS)),
            score=score,
            own=own,
            information=0.9 * own.sum(axis=0),
            levels={
                "slot": tuple(map(str, range(UNITS))),
                "wafer": tuple(f"w{w}" for w in rng.integers(0, 8, UNITS)),
                "firmware": (f"f{int(k >= 180)}",) * UNITS,
            },
            numbers={"radius": rng.uniform(0.0, 1.0, UNITS)},
        )
        out.append(change(lot, k))
    return out


def evidence_of(given: list[ScoredLot]) -> Evidence:
    made = Evidence(COUNT, earlier_in(given))
    for lot in given:
        made.add(lot)
    return made


def largest(made: Evidence) -> dict[str, float]:
    return {name: float(sums.log_e.max()) for name, sums in made.drivers.items()}


def added(lot: ScoredLot, size: np.ndarray) -> ScoredLot:
    """A lot with coefficients (units,) of its third hypothesis more."""
    score = lot.score.copy()
    score[:, 2] += size * lot.own[:, 2]
    return replace(lot, score=score)


@pytest.mark.parametrize(("archives", "most"), [(4, 2), pytest.param(40, 5, marks=pytest.mark.slow)])
def test_archives_without_anything_hidden_stay_silent(archives: int, most: int) -> None:
    loud = [seed for seed in range(archives) if max(largest(evidence_of(lots(seed, 200))).values()) > NEEDED]
    assert len(loud) <= most  # 5 % are allowed; more than this come with 1 %


def test_one_lot_multiplies_the_evidence_by_1_65_at_most(rng: np.random.Generator) -> None:
    for two_sided in (True, False):
        sums = Sums.of(1, two_sided=two_sided)
        for x in rng.standard_cauchy(300):
            before = float(sums.log_e[0])
            sums.add(np.array([x]))
            assert float(sums.log_e[0]) <= before + 0.5 + 1e-9 or before < 0.0


def test_an_effect_as_a_whole_is_found_before_its_parts_and_in_noise_is_silent() -> None:
    """Nine hypotheses are three columns on three axes; the last column is an effect of its own."""
    columns = np.array([0, 0, 1])

    def spread(lot: ScoredLot, _: int) -> ScoredLot:
        score = lot.score.copy()
        score[:, [0, 1, 3, 4, 6, 7]] += 0.016 * lot.own[:, [0, 1, 3, 4, 6, 7]]
        return replace(lot, score=score)

    made = Evidence(COUNT, columns=columns)
    for lot in lots(15, 150, spread):
        made.add(lot)
    assert (made.axes, made.size) == (3, COUNT + 2)
    log_e = made.drivers["mean"].log_e
    assert log_e.size == made.size
    assert log_e[COUNT] > log_e[:COUNT].max() + 3.0
    assert log_e[COUNT + 1] < NEEDED
    assert log_e[:COUNT] == pytest.approx(evidence_of(lots(15, 150, spread)).drivers["mean"].log_e)
    state = again_from_json(made)
    assert state.drivers["mean"].log_e == pytest.approx(log_e)


def again_from_json(evidence: Evidence) -> Evidence:
    """An evidence whose state was written and read."""
    arrays = list[np.ndarray]()
    plain = json.dumps(stored(evidence, arrays))
    return restored(json.loads(plain), [array.copy() for array in arrays])


def test_stations_share_what_all_axes_show_alike_and_not_an_error_of_their_own(rng: np.random.Generator) -> None:
    columns = np.array([0, 1, 2])

    def shares(sizes: np.ndarray) -> np.ndarray:
        """Whether stations (k, 9) of these sizes, well known, share them."""
        made = Evidence(COUNT, columns=columns)
        made.levels["station"] = table = Levels(COUNT)
        for k, size in enumerate(sizes):
            table.add((f"s{k}",), 1e6 * size[None], np.full((1, COUNT), 1e6))
            made.wander.level(f"s{k}")
        made._scales = {"between": Scale(np.ones(COUNT))}
        return made.shared_by_stations()

    alike = 1.0 + 0.35 * np.array([-1.0, -0.6, 0.6, 1.0])[:, None] * np.ones(COUNT)
    alone = alike.copy()
    alone[:, 1:] = rng.standard_normal((4, COUNT - 1)) * np.array([1.0, -1.0, 1.0, -1.0])[:, None]
    assert shares(alike).all()
    assert not shares(alone)[0]  # on one axis alone that is not enough
    false = sum(bool(shares(rng.standard_normal((4, COUNT))).any()) for _ in range(200))
    assert false <= 14  # three columns at 0.5 % together, nine hypotheses at 0.6 %: 7 % at most


def test_a_bad_lot_is_no_discovery() -> None:
    def bad(lot: ScoredLot, k: int) -> ScoredLot:
        return added(lot, np.full(UNITS, 40.0)) if k in {7, 90} else lot

    assert max(largest(evidence_of(lots(3, 200, bad))).values()) < NEEDED


FOUND: dict[str, Change] = {
    "mean": lambda lot, _: added(lot, np.full(UNITS, 0.03)),
    "slot": lambda lot, _: added(lot, np.linspace(-0.08, 0.08, UNITS)),
    f"wafer{INSIDE}": lambda lot, _: added(lot, np.array([0.1 * (int(w[1:]) % 2 - 0.5) for w in lot.levels["wafer"]])),
    f"radius{INSIDE}": lambda lot, _: added(lot, 0.15 * (lot.numbers["radius"] - 0.5)),
    "station": lambda lot, _: added(lot, np.full(UNITS, 0.06 if lot.station == "s1" else -0.06)),
    "firmware": lambda lot, k: added(lot, np.full(UNITS, 0.2 if k >= 180 else 0.0)),
    "unit": lambda lot, _: added(lot, np.array([0.12 * (-1.0) ** int(u[1:].split("-")[0]) for u in lot.units])),
}


@pytest.mark.parametrize("driver", mostly_slow(FOUND, f"wafer{INSIDE}", "firmware"))
def test_what_is_hidden_is_found_by_its_driver(driver: str) -> None:
    made = evidence_of(lots(5, 400, FOUND[driver]))
    assert float(made.drivers[driver].log_e[2]) > NEEDED
    beside = {"firmware": {"mean", "station", "date"}, "unit": {"slot"}, "station": {"mean"}}.get(driver, set())
    beside |= {name for name in made.drivers if name.split(",")[0] == driver.split(",", maxsplit=1)[0]}
    assert max(value for name, value in largest(made).items() if name not in beside) < NEEDED


def test_a_station_that_wanders_is_no_firmware_and_is_told() -> None:
    rng = np.random.default_rng(8)
    level = {"s0": 0.0, "s1": 0.0}

    def wander(lot: ScoredLot, _: int) -> ScoredLot:
        level[lot.station] = 0.98 * level[lot.station] + 0.2 * 0.15 * rng.standard_normal()
        return added(lot, np.full(UNITS, level[lot.station]))

    made = evidence_of(lots(9, 500, wander))
    assert made.guarded[2]
    assert not made.guarded[:2].any()
    silent = {name: value for name, value in largest(made).items() if name not in {"mean", "station", "date"}}
    assert max(silent.values()) < NEEDED


def test_a_state_goes_on_where_it_was() -> None:
    given = lots(6, 120, FOUND["slot"])
    whole, order = evidence_of(given), list[ScoredLot]()
    first = Evidence(COUNT, earlier_in(order))
    for lot in given[:70]:
        first.add(lot)
        order.append(lot)
        assert ("mean" in first.drivers) == (len(order) >= FIRST)  # the first lots are held back
    again = again_from_json(first)
    again.earlier = earlier_in(order)
    for lot in given[70:]:
        again.add(lot)
        order.append(lot)
    for name, sums in whole.drivers.items():
        assert again.drivers[name].log_e == pytest.approx(sums.log_e, abs=1e-9, rel=1e-9), name


def test_a_number_that_differs_by_axis_is_judged_inside_the_lot() -> None:
    scale = 0.05
    rng = np.random.default_rng(21)

    def sloped(lot: ScoredLot, _: int) -> ScoredLot:
        numbers = rng.standard_normal((UNITS, COUNT))
        return replace(added(lot, scale * numbers[:, 2]), slopes={"number": numbers})

    made = evidence_of(lots(7, 220, sloped))
    log_e = made.drivers["number" + INSIDE].log_e
    assert int(np.argmax(log_e)) == 2
    assert log_e[2] > NEEDED
    assert np.delete(log_e, 2).max() < NEEDED
    sums = made.levels["number" + INSIDE]
    slope, every = sums.place[SLOPE], sums.place[ALL]
    information = sums.information[slope]
    error = 1.0 / np.sqrt(information[2])
    assert sums.score[slope, 2] / information[2] == pytest.approx(scale, abs=4.0 * error)
    inside = np.sqrt(information / sums.information[every])
    assert inside == pytest.approx(np.full(COUNT, np.sqrt(1.0 - 1.0 / UNITS)), rel=0.1)
