"""Whoever reads dwells hands the same state to the science: every recorded quantity, with gaps, pauses and power-off."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inertial.quantities import BY_ATTRIBUTE, RECORDED
from inertial.state import History, State
from pipelines.diagnosis import compare, diagnose
from pipelines.rerun import lot_comparison
from pipelines.stages import fit, noisy_fit, verify
from pipelines.tables import sound_lot
from pipelines.tables.dwells import LotTables

MODEL = ["bias", "scale", "misalignment"]
DERIVED_LATER = {"felt", "output_run", "memory"}
SURROUNDINGS = [
    row for row in RECORDED if row.column not in ("time_s", "power_off_s", "slot", "outer_deg", "inner_deg")
]
COVARIATES = ("fan_rpm", "dew_point_C")


class Handed(Exception):
    """What a reader handed to the science."""

    def __init__(self, state):
        super().__init__("handed on")
        self.state = state


def handing(find):
    def stop(*given, **more):
        raise Handed(find(*given, **more))

    return stop


def by_rerun(dwells, history):
    units = tuple(dwells["unit"].unique())
    calibration = SimpleNamespace(units=units, effects=(), coefficients=np.zeros(len(units)), nonlinear={})
    lot_comparison.applied(calibration, units, dwells, history)


WHOLE = {
    "fit": lambda dwells, history: fit.fit(dwells, history, MODEL),
    "verify": lambda dwells, history: verify.verify(dwells, history, pd.DataFrame({"unit": ["A"]}), dwells, dwells),
    "rerun and what-if": by_rerun,
}
LENIENT = {
    "diagnose": lambda dwells, history: diagnose.diagnose(dwells, history, MODEL),
    "compare": lambda dwells, history: compare.compare(dwells, MODEL, history),
}


@pytest.fixture(autouse=True, scope="module")
def science_that_only_listens():
    """Every reader's first call of the science gives its state away."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(noisy_fit, "profiled", handing(lambda lot, *_: lot.state))
        patch.setattr(verify, "correct", handing(lambda _, state, *__: state))
        patch.setattr(verify, "read_calibration", lambda *_: SimpleNamespace(effects=(), coefficients=(), nonlinear={}))
        patch.setattr(lot_comparison, "correct", handing(lambda _, state, *__: state))
        patch.setattr(diagnose, "diagnose_lot", handing(lambda lot, *_: lot.state))
        patch.setattr(sound_lot, "find_faults", lambda _: [])
        patch.setattr(compare, "Problem", handing(lambda lot: lot.state))
        yield


def state_by(reader, dwells, history):
    try:
        reader(dwells, history)
    except Handed as handed:
        return handed.state
    pytest.fail("the science was not called")


@st.composite
def lots(draw, gaps):
    """Dwells and history of a lot: columns that are there, half there or not, switched devices, pauses, rows in any order."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    units, n = draw(st.integers(1, 3)), draw(st.integers(12, 16))
    unit, dwell = (index.ravel() for index in np.indices((units, n)))
    pauses = draw(st.lists(st.sampled_from([0.0, 0.0, 7200.0]), min_size=n, max_size=n))
    time = np.cumsum(20.0 + np.array(pauses))
    frame = pd.DataFrame({
        "unit": np.array(["A", "B", "C"], dtype=object)[unit], "dwell": dwell, "time_s": time[dwell],
        "kind": np.where(dwell % 5 == 4, "verification", "dwell"), "pose": [f"p{one}" for one in dwell],
        "out_unit": "g", "slot": 2 * unit + 1, "n": 100, "outer_deg": rng.uniform(-180.0, 180.0, unit.size),
        "inner_deg": rng.uniform(-180.0, 180.0, unit.size),
    })  # fmt: skip
    towards = rng.standard_normal((n, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    for axis, letter in enumerate("xyz"):
        frame[f"force_{letter}"] = towards[dwell, axis]
        frame[f"out_{letter}"] = towards[dwell, axis] + 1e-4 * rng.standard_normal(unit.size)
        frame[f"sd_{letter}"] = rng.uniform(1e-5, 2e-5, unit.size)
    for column in (*(row.column for row in SURROUNDINGS), *COVARIATES):
        how = draw(st.sampled_from(["whole", "whole", "whole", "gap", "still", "none"]))
        if how != "none":
            frame[column] = rng.uniform(1.0, 60.0) + (0.0 if how == "still" else 1.0) * rng.standard_normal(unit.size)
        if how == "gap":
            frame.loc[int(rng.integers(unit.size)), column] = np.nan
    if draw(st.booleans()):
        off = draw(st.lists(st.sampled_from([0.0, 0.0, 600.0]), min_size=n, max_size=n))
        frame["power_off_s"] = np.array(off)[dwell]
    if draw(st.booleans()):
        frame = frame.drop(columns=["force_x", "force_y", "force_z"])
    elif draw(st.booleans()):
        frame = frame.drop(columns=["outer_deg", "inner_deg"])
    if gaps:
        frame = frame.drop(index=draw(st.lists(st.integers(0, unit.size - 1), min_size=1, max_size=2, unique=True)))
    history = draw(histories(rng, units, time[-1]))
    return (frame if draw(st.booleans()) else frame.sample(frac=1.0, random_state=1)), history


@st.composite
def histories(draw, rng, units, end):
    when = np.linspace(0.0, end, 30)
    kind = draw(st.sampled_from(["by unit", "chamber", "beside the run", "with a gap"]))
    if kind == "chamber":
        return pd.DataFrame({"time_s": when, "chamber_C": rng.uniform(20.0, 30.0, when.size)})
    if kind == "beside the run":
        when = when + 10.0 * end
    unit, place = (index.ravel() for index in np.indices((units, when.size)))
    names = np.array(["A", "B", "C"], dtype=object)[unit]
    frame = pd.DataFrame({"unit": names, "time_s": when[place], "unit_C": rng.uniform(20.0, 30.0, unit.size)})
    if kind == "with a gap":
        frame.loc[3, "unit_C"] = np.nan
    return frame


def assert_same(one: State, other: State) -> None:
    for item in fields(State):
        if item.name in DERIVED_LATER:
            continue
        a, b = getattr(one, item.name), getattr(other, item.name)
        if isinstance(a, History) and isinstance(b, History):
            a, b = vars(a), vars(b)
        assert (a is None) == (b is None), item.name
        np.testing.assert_equal(a, b, err_msg=item.name)


slowly = settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


@slowly
@given(lots(gaps=False))
def test_every_reader_hands_on_the_same_state(lot):
    dwells, history = lot
    states = {name: state_by(reader, dwells, history) for name, reader in (WHOLE | LENIENT).items()}
    for state in states.values():
        assert_same(state, states["fit"])


@pytest.mark.slow
@slowly
@given(lots(gaps=True))
def test_where_units_lack_dwells_a_lot_is_fitted_in_parts_and_the_others_read_alike(lot):
    dwells, history = lot
    if len(dwells) != dwells["unit"].nunique() * dwells["dwell"].nunique():
        first = LotTables(dwells, history).parts[0].dwells
        for reader in (WHOLE["fit"], by_rerun):
            assert_same(*(state_by(reader, table, history) for table in (dwells, first)))
    assert_same(*(state_by(reader, dwells, history) for reader in LENIENT.values()))


@settings(slowly, max_examples=12)
@given(lots(gaps=False))
def test_every_recorded_quantity_is_in_the_state(lot):
    """Against a plain pivot of the table, which no reader has a part in."""
    dwells, history = lot
    state = state_by(WHOLE["fit"], dwells, history)
    for row in RECORDED:
        if row.column not in dwells or dwells[row.column].isna().any() or row.once:
            continue
        if row.column == "power_off_s" and state.since_power is None:
            continue
        wide = row.factor * dwells.pivot_table(index="unit", columns="dwell", values=row.column).to_numpy()
        recorded = getattr(state, row.attribute) if row.attribute else state.covariates[row.column]
        np.testing.assert_allclose(recorded, wide, rtol=1e-14, err_msg=row.column)
    for column in COVARIATES:
        assert (column in state.covariates) == (column in dwells and not dwells[column].isna().any())
    if "power_off_s" in dwells:
        assert (state.power_off is None) == (state.since_power is None)


def test_every_field_of_the_state_is_a_recorded_quantity():
    other = {"force", "felt", "output_run", "covariates", "history", "memory", "reference", "axes"}
    assert {item.name for item in fields(State)} == other | set(BY_ATTRIBUTE)
