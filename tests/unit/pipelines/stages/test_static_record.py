"""The noise stage on static records that are not as one would like them: silent, short, coarse, and in a room that drifts."""

import independent_lots as lots
import independent_noise as made
import numpy as np
import pandas as pd
import pytest

from pipelines.stages.fit import fit
from pipelines.stages.noise import noise, static_record
from pipelines.stages.static_record import Coarse
from schemas.table_check import check

RATE, N, WHITE = 10.0, 6000, 100.0
EFFECTS = ["bias", "scale", "misalignment", "bias_temperature"]


@pytest.fixture(scope="module")
def calibration() -> dict[str, pd.DataFrame]:
    """Three units without noise to speak of, with a tempco of 50 µg/K."""
    made_ = lots.world(
        np.random.default_rng(5_150_901), units=3, temperatures=(0.0, 25.0, 50.0), flicker=0.0, density=1.0, day_s=0
    )
    dwells = made_.dwells
    for axis in "xyz":
        dwells[f"out_{axis}"] += 50e-6 * (dwells["unit_C"] - 25.0)
    return fit(dwells, lots.NO_HISTORY, EFFECTS)


def terms(
    calibration: dict[str, pd.DataFrame], values: np.ndarray, history: pd.DataFrame | None = None, n_rate: float = RATE
):
    """Table ``noise`` of records (units, n, 3) in µg, by unit, axis and term."""
    samples, readings = lots.static_record(1e-6 * values, n_rate)
    tables = noise(static_record([samples], readings, calibration["coefficients"], calibration["covariance"], history))
    check("noise", tables["noise"])
    check("allan", tables["allan"])
    return tables["noise"].set_index(["unit", "axis", "term"]).sort_index()


def white(rng: np.random.Generator, n: int = N) -> np.ndarray:
    return made.white(rng, 9, n, WHITE, RATE).reshape(3, 3, n).transpose(0, 2, 1)


def test_one_silent_channel_is_told_and_the_others_have_their_terms(calibration: dict) -> None:
    values = white(np.random.default_rng(5_150_902))
    values[1, :, 2] = 17.0
    table = terms(calibration, values)
    silent = table.loc["U001", "z"]
    assert silent["value"].isna().all()
    assert silent["high"].isna().all()
    assert silent["note"].str.contains("never changed").all()
    others = table.drop(index=[("U001", "z", t) for t in silent.index]).xs("n_d", level="term")
    assert len(others) == 8
    np.testing.assert_allclose(others["value"], WHITE, rtol=0.08)


def test_a_short_record_and_one_that_is_not_finite_refuse_nobody_else(calibration: dict) -> None:
    values = white(np.random.default_rng(5_150_903))
    values[0, 5, 1] = np.nan
    samples, readings = lots.static_record(1e-6 * values, RATE)
    samples = samples.drop(samples.index[samples["unit"] == "U002"][100:])
    table = noise(static_record([samples], readings, calibration["coefficients"], calibration["covariance"]))["noise"]
    note = table.set_index(["unit", "axis", "term"])["note"]
    assert "not finite" in note["U000", "y", "N"]
    assert "100 samples" in note["U002", "x", "N"]
    assert table[(table["unit"] == "U001") & (table["term"] == "N")]["identified"].all()


def test_a_jump_in_one_channel_leaves_limits_there_and_terms_elsewhere(calibration: dict) -> None:
    values = white(np.random.default_rng(5_150_905))
    values[1, 2500:, 1] += 400.0
    table = terms(calibration, values)
    struck = table.loc["U001", "y"]
    assert not struck["identified"].any()
    assert struck["note"].drop("B_bound").str.startswith("the mean jumps by +").all()
    at = float(struck["note"]["N"].removesuffix(" s").rpartition(" ")[2])
    assert at == pytest.approx(250.0, abs=2.0)
    assert np.isfinite(struck["high"]).all()
    others = table.drop(index=[("U001", "y", t) for t in struck.index]).xs("N", level="term")
    assert others["identified"].all()


@pytest.mark.slow
def test_the_known_tempco_of_a_drifting_room_is_taken_out_of_a_record_and_told(calibration: dict) -> None:
    rng = np.random.default_rng(5_150_904)
    n = 36_000
    history, course = lots.room(rng, 3, n / RATE, 1.0)
    drift = 50.0 * (np.interp(np.arange(n) / RATE, np.arange(0.0, n / RATE + 1.0, 10.0), course) - 25.0)
    values = 0.25 * white(rng, n) + drift[None, :, None]
    raw, taken = terms(calibration, values), terms(calibration, values, history)
    walk = taken.xs("K", level="term")
    false = np.any([raw.xs(term, level="term")["identified"] for term in "KRB"], axis=0)
    assert false.mean() > 0.5
    assert not walk["identified"].any()
    assert walk["note"].str.contains("share of the known tempco").all()
    assert (walk["high"] < 0.3 * raw.xs("K", level="term")["high"]).all()


def rounded(calibration: dict, seed: int, step: float) -> pd.DataFrame:
    """White noise in steps of a share of its standard deviation: the density by unit and axis."""
    rng = np.random.default_rng(seed)
    lsb = step * WHITE * np.sqrt(RATE / 2.0)
    values = white(rng, 20_000) + rng.uniform(0.0, lsb, (3, 1, 3))
    return terms(calibration, lsb * np.round(values / lsb)).xs("n_d", level="term")


@pytest.mark.parametrize("step", [1.0, 1.8], ids=["as large as the noise", "nearly twice the noise"])
def test_what_rounding_adds_is_taken_out_of_the_white_noise(calibration: dict, step: float) -> None:
    rows = rounded(calibration, 5_150_905, step)
    assert rows["note"].str.contains("subtracted from N").all()
    np.testing.assert_allclose(rows["value"], WHITE, rtol=0.04)
    assert (rows["low"] < WHITE).mean() > 0.8
    assert (rows["high"] > WHITE).mean() > 0.8


def test_digits_coarser_than_the_noise_leave_a_limit_that_holds_and_no_value(calibration: dict) -> None:
    rows = rounded(calibration, 5_150_906, 5.0)
    spoken = rows[~rows["note"].str.contains("never changed")]
    assert len(spoken) > 3
    assert not spoken["identified"].any()
    assert spoken["note"].str.contains("finer resolution").all()
    assert (spoken["high"] >= WHITE).all()
    fine = (Coarse(step=0.1, variance=1.0, most=np.inf), Coarse(step=0.0, variance=0.0, most=np.inf))
    assert [one.matters for one in fine] == [False, False]
