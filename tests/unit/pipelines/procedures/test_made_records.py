"""Figures of records that are made here: a jump in an hour of stability, a unit that is constant, random vibration."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import signal

from pipelines.procedures import PROCEDURES
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, ProcedureStep, UnitRecord
from schemas.recipe import Recipe

SCALE = 0.007
ANALOGUE = Device({}, {}, full_scale=0.35, out_unit="V")


STABILITY: Any = PROCEDURES["bias_stability"]


@pytest.mark.parametrize("jump", [0.0, 40.0])
def test_a_jump_of_the_mean_is_told_and_a_quiet_hour_has_no_such_text(jump: float, rng: np.random.Generator) -> None:
    n = 3600
    value = 5.0 * rng.standard_normal(n) + jump * (np.arange(n) >= 2000)
    rows = pd.DataFrame(
        {"unit": "A1", "axis": "z", "series": "mean_1s", "point": np.arange(n), "setting": np.arange(n) * 1.0, "value": value,
         "uncertainty": 0.5}
    )  # fmt: skip
    part = STABILITY.part.model_validate({"kind": "bias_stability", "scale": 1.0})
    outcome = STABILITY.evaluate(part, rows, Device({}, {}, 2.0, "g"))
    told = [one.text for one in outcome.findings if one.subject == "disturbed record"]
    assert bool(told) == bool(jump)
    assert all(text.startswith("axis z: the mean jumps by +") for text in told)


def made(kind: str, step: ProcedureStep, number: int, rng: np.random.Generator) -> ProcedureRecord:
    """A record of a live unit, a still one, and the reference."""
    if kind == "tilt":
        time = np.arange(20) / 10.0
        alpha = np.radians(step.setting["angle_deg"])
        force = np.tile([0.0, np.sin(alpha), np.cos(alpha)], (20, 1))
    else:
        time = np.arange(int((step.lasting_s or 0.0) * 20000.0)) / 20000.0
        wave = step.setting["level_g"] * np.cos(2.0 * np.pi * step.setting["frequency_hz"] * time)
        force = np.outer(wave, [1e-3, 1e-3, 1.0])
    live = SCALE * force + rng.normal(0.0, 1e-6, force.shape)
    samples = {"live": UnitRecord(time, live), "still": UnitRecord(time, np.zeros_like(force))}
    angle = step.setting.get("angle_deg", 0.0)
    readings = pd.DataFrame([{"unit": unit, "outer_deg": angle, "unit_C": 25.0} for unit in samples])
    if kind == "sweep":
        samples[REFERENCE] = UnitRecord(time, force + rng.normal(0.0, 1e-5, force.shape))
    return ProcedureRecord(number, step, readings, samples)


@pytest.mark.parametrize(
    ("kind", "keys", "reason"),
    [
        ("tilt", {"step_deg": 30.0}, "constant; check the unit"),
        ("sweep", {"low_hz": 20.0, "high_hz": 500.0, "per_octave": 2, "nominal_scale": SCALE}, "check cable and range"),
    ],
)
def test_a_still_unit_has_no_figures_and_says_why(kind: str, keys: dict[str, float], reason: str) -> None:
    procedure = PROCEDURES[kind]
    part = procedure.part(kind=kind, **keys)
    recipe = Recipe.model_construct()
    rng = np.random.default_rng(5)
    records = [made(kind, step, k, rng) for k, step in enumerate(procedure.steps(part, recipe))]
    points = procedure.reduce(part, records, ANALOGUE)
    outcome = procedure.evaluate(part, points, ANALOGUE)
    still, live = outcome.figures["still"], outcome.figures["live"]
    assert len(still) == len(procedure.figures)
    assert not any(one.identified for one in still)
    assert {one.note for one in still} == {still[0].note}
    assert reason in still[0].note
    assert any(one.identified for one in live)
    assert procedure.chart(part, points[points["unit"] == "still"]) is None
    assert procedure.chart(part, points[points["unit"] == "live"]) is not None


def test_the_end_of_the_range_is_seen_where_the_converter_rounds_it() -> None:
    """An analogue output of 0.35 V reads 0.34999999 V behind 24 bits, and 7 mV/g make it 49.999998 g."""
    assert ANALOGUE.at_end(np.array([0.0, 0.34999999, -0.34999999, 0.349])) == 2


RATE_HZ, OWN_HZ = 20_000.0, 5_000.0


def recording(
    step: ProcedureStep, rng: np.random.Generator, natural_hz: float, damping: float, clock: float
) -> dict[str, UnitRecord]:
    """A second of rest, the vibration, a second of rest, as two recorders take them; by the differential equation."""
    seconds = (step.lasting_s or 0.0) + 2.0
    n = int(seconds * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    band = signal.butter(6, [20.0, 2000.0], "bandpass", fs=RATE_HZ, output="sos")
    x = signal.sosfilt(band, rng.standard_normal(n)) * ((t > 1.0) & (t < seconds - 1.0))
    x *= step.setting["level_g"] / x[int(1.5 * RATE_HZ) : -int(1.5 * RATE_HZ)].std()
    w = 2.0 * np.pi * natural_hz
    fine = signal.resample(x, 4 * n)
    system: Any = signal.cont2discrete(([w**2], [1.0, 2.0 * damping * w, w**2]), 0.25 / RATE_HZ, method="foh")
    y = signal.lfilter(system[0].ravel(), system[1], fine)
    at = np.arange(int((seconds - 0.01) * OWN_HZ)) / OWN_HZ
    own = SCALE * np.interp(at * (1.0 + clock), np.arange(4 * n) / (4.0 * RATE_HZ), y)
    own += 2e-6 * rng.standard_normal(own.size)
    reference, output = np.zeros((n, 3)), np.zeros((own.size, 3))
    reference[:, 2], output[:, 2] = x, own
    return {"S1": UnitRecord(at, output), REFERENCE: UnitRecord(t, reference)}


def test_natural_frequency_damping_and_clock_from_random_vibration() -> None:
    rng, clock = np.random.default_rng(15), 3e-5
    procedure: Any = PROCEDURES["random_vibration"]
    part = procedure.part(kind="random_vibration", levels_g=[1.0, 2.0, 3.0], seconds=6.0, scale=SCALE)
    readings = pd.DataFrame([{"unit": "S1", "unit_C": 25.0, "full_scale": 0.35, "out_unit": "V"}])
    records = [
        ProcedureRecord(number, step, readings, recording(step, rng, 900.0, 0.6, clock))
        for number, step in enumerate(procedure.steps(part, Recipe.model_construct()))
    ]
    outcome = procedure.evaluate(part, procedure.reduce(part, records, ANALOGUE), ANALOGUE)
    figures = {one.figure: one for one in outcome.figures["S1"]}
    for name, true in (("random_natural_hz", 900.0), ("random_damping", 0.6)):
        assert figures[name].identified, figures[name].note
        assert figures[name].value == pytest.approx(true, rel=0.005)
    said = {one.subject: one.text for one in outcome.findings}
    assert "is adequate" in said["model"]
    assert said["clock of the device"].startswith("+30 ")
