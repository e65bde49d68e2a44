"""A verdict is about the sensors: it does not depend on order, names, clock, frame or units in which they were written down."""

from collections.abc import Callable
from functools import cache
from itertools import permutations, product
from typing import Any

import numpy as np
import pandas as pd
import pytest
from generated import FEW
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from long_suites import mostly_slow
from lots import Physics, lot

from pipelines.diagnosis.diagnose import diagnose

pytestmark = pytest.mark.usefixtures("no_next_measurement")

FEWER = settings(FEW, max_examples=1, phases=(Phase.explicit, Phase.generate))
OUTPUTS = {"g": 1.0, "m/s^2": 9.80665, "LSB": 256000.0, "V": 0.3}
TURNS = [
    matrix
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(matrix := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0.0
]
"""The 24 rotations that take axes to axes."""

WORLDS: dict[str, Physics | None] = {
    "nothing hidden": None,
    "a cubic": lambda f, warm, time, rng: 2e-4 * f**3,
    "a square": lambda f, warm, time, rng: 2e-4 * f**2,
}


@cache
def measured(world: str) -> pd.DataFrame:
    frame = lot(np.random.default_rng(5), units=2, temperatures=(25.0,), hidden=WORLDS[world])
    outer, inner = np.radians(frame["outer_deg"]), np.radians(frame["inner_deg"])
    force = np.stack([np.sin(outer) * np.sin(inner), np.sin(outer) * np.cos(inner), np.cos(outer)], axis=1)
    frame = frame.drop(columns=["outer_deg", "inner_deg"]).assign(out_unit="g")
    return frame.assign(**{f"force_{axis}": force[:, k] for k, axis in enumerate("xyz")})


def verdict(frame: pd.DataFrame) -> dict[str, Any]:
    document = diagnose(frame)
    return {
        "adequate": document["adequate"],
        "blocked": len(document["blocked_by"]),
        "classes": [one["effects"] for one in document["classes"]],
        "recommended": document["recommended"],
        "removed": document["removed"] is not None,
        "numbers": [document["error"][name] for name in ("rms_ug", "floor_ug", "white_noise_ug")],
        "p_value": document["error"]["p_value"],
    }


@cache
def expected(world: str) -> dict[str, Any]:
    return verdict(measured(world))


def assert_the_same(frame: pd.DataFrame, world: str, *, redrawn: bool) -> None:
    """The p-value is left out where the series that it is simulated from are drawn for other axes."""
    found, wanted = verdict(frame), expected(world)
    assert found.pop("numbers") == pytest.approx(wanted["numbers"], rel=1e-6)
    p_value = found.pop("p_value")
    assert redrawn or p_value == pytest.approx(wanted["p_value"], rel=1e-3, abs=1e-9)
    assert found == {name: wanted[name] for name in found}


Change = Callable[[pd.DataFrame, st.DataObject], pd.DataFrame]


def written_otherwise(frame: pd.DataFrame, data: st.DataObject) -> pd.DataFrame:
    """Rows and columns in any order, units of other names, dwells of other numbers, and a clock that was set otherwise."""
    names = data.draw(
        st.lists(st.from_regex(r"[A-Z][A-Z0-9]{1,5}", fullmatch=True), min_size=2, max_size=2, unique=True)
    )
    frame = frame.sample(frac=1.0, random_state=data.draw(st.integers(0, 2**32 - 1)))
    frame = frame.assign(
        unit=frame["unit"].map(dict(zip(["U000", "U001"], names, strict=True))),
        dwell=data.draw(st.integers(1, 9)) * frame["dwell"] + data.draw(st.integers(0, 1000)),
        time_s=frame["time_s"] + data.draw(st.integers(0, 10**6)),
    )
    return frame[data.draw(st.permutations(list(frame.columns)))]


def axes_turned(frame: pd.DataFrame, data: st.DataObject) -> pd.DataFrame:
    turn = data.draw(st.sampled_from(TURNS))
    turned = {}
    for name in ("out", "force", "sd"):
        columns = [f"{name}_{axis}" for axis in "xyz"]
        matrix = np.abs(turn) if name == "sd" else turn
        turned |= dict(zip(columns, (frame[columns].to_numpy() @ matrix.T).T, strict=True))
    return frame.assign(**turned)


def outputs_in_another_unit(frame: pd.DataFrame, data: st.DataObject) -> pd.DataFrame:
    unit = data.draw(st.sampled_from(list(OUTPUTS)))
    scaled = {f"{name}_{axis}": OUTPUTS[unit] * frame[f"{name}_{axis}"] for name in ("out", "sd") for axis in "xyz"}
    return frame.assign(**scaled, out_unit=unit)


@pytest.mark.parametrize("world", mostly_slow(WORLDS, "nothing hidden", "a cubic"))
@pytest.mark.parametrize(
    "change", [written_otherwise, axes_turned, outputs_in_another_unit], ids=lambda change: change.__name__
)
@FEWER
@given(data=st.data())
def test_a_verdict_stays_with(change: Change, world: str, data: st.DataObject) -> None:
    assert_the_same(change(measured(world), data), world, redrawn=change is axes_turned)


def test_the_worlds_have_the_verdicts_that_they_were_made_for() -> None:
    found = [(expected(world)["adequate"], expected(world)["recommended"]) for world in WORLDS]
    assert found == [(True, []), (False, ["third_order"]), (False, ["second_order"])]
