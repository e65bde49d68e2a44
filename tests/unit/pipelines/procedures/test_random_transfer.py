"""The transfer function from random vibration of a station: figures against the system that made the samples."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import signal

from pipelines.procedures.random_vibration import PROCEDURE, RandomVibrationPart
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, ProcedureStep, UnitRecord
from schemas.recipe import Recipe

RATE_HZ, OWN_HZ, SCALE = 20_000.0, 5_000.0, 0.007


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
    part = RandomVibrationPart(kind="random_vibration", levels_g=[1.0, 2.0, 3.0], seconds=6.0, scale=SCALE)
    readings = pd.DataFrame([{"unit": "S1", "unit_C": 25.0, "full_scale": 0.35, "out_unit": "V"}])
    records = [
        ProcedureRecord(number, step, readings, recording(step, rng, 900.0, 0.6, clock))
        for number, step in enumerate(PROCEDURE.steps(part, Recipe.model_construct()))
    ]
    device = Device({}, {}, 0.35, "V")
    outcome = PROCEDURE.evaluate(part, PROCEDURE.reduce(part, records, device), device)
    figures = {one.figure: one for one in outcome.figures["S1"]}
    for name, true in (("random_natural_hz", 900.0), ("random_damping", 0.6)):
        assert figures[name].identified, figures[name].note
        assert figures[name].value == pytest.approx(true, rel=0.005)
    said = {one.subject: one.text for one in outcome.findings}
    assert "is adequate" in said["model"]
    assert said["clock of the device"].startswith("+30 ")
