"""The choice of a device: its budget against one simulated by hand from the preset, and what is refused."""

import math

import numpy as np
import pytest
from each import each
from in_process import document_of, refused

from stations.plant.preset import load_preset

ASKED = ("range=4g", "temperature=-40..85", "error=2mg", "bandwidth=100")


def test_the_error_of_devices_as_delivered_is_that_of_devices_drawn_from_their_preset() -> None:
    rng = np.random.default_rng(31)
    part = load_preset("SF1500")
    n = 200_000
    warm = rng.uniform(-40.0, 85.0, n) - 25.0
    error = rng.normal(part.bias_mean_g, part.bias_sd_g, n) * 1e6
    error += 4.0 * (rng.normal(0.0, part.scale_sd_ppm, n) + part.scale_tempco_ppm_per_K * warm)
    error += 4.0 * 1e3 * rng.normal(0.0, part.misalignment_sd_mrad, n) + part.bias_tempco_ug_per_K * warm * rng.choice(
        [-1.0, 1.0], n
    )
    rows = document_of("plan", "choose", *ASKED)["candidates"]
    own = next(row for row in rows if row["device"] == "SF1500" and row["calibration"] == "none")
    assert own["error_ug"] == pytest.approx(2.0 * float(np.sqrt(np.mean(error**2))), rel=0.02)
    assert own["terms_ug"]["noise in the bandwidth"] == pytest.approx(7.0 * math.sqrt(0.5 * math.pi * 100.0))


def test_the_first_reaches_the_error_with_the_least_calibration_and_a_calibration_never_makes_it_worse() -> None:
    document = document_of("plan", "choose", *ASKED, status=0)
    first = document["candidates"][0]
    assert (first["reaches"], first["calibration"], first["why"]) == (True, "temperature", [])
    for device in ("ADXL355", "SF1500", "QA700", "analogue"):
        own = {row["calibration"]: row["error_ug"] for row in document["candidates"] if row["device"] == device}
        assert sorted(own.values(), reverse=True) == [own[name] for name in document["calibrations"]]
    analogue = [row for row in document["candidates"] if row["device"] == "analogue"]
    assert all(row["cannot"][0].startswith("saturates at 3.6 g") and not row["reaches"] for row in analogue)
    assert document_of("plan", "choose", "range=4g", "error=1ug", status=1)["candidates"][0]["reaches"] is False


REFUSED = [
    (("range=4", "error=2mg"), "range: found '4', a positive number with g or mg is needed"),
    (("range=4g", "error=nang"), "error: found 'nang'"),
    (("range=4g", "error=2mg", "temperature=85..-40"), "LOW..HIGH in °C is needed"),
    (("range=4g", "error=2mg", "bandwidth=0"), "a frequency above 0 Hz is needed"),
    (("range=4g", "error=2mg", "--device", "adxl335"), "did you mean ADXL355"),
]


@each(REFUSED)
def test_a_need_that_cannot_be_read_is_refused(row: tuple[tuple[str, ...], str]) -> None:
    assert row[1] in refused("plan", "choose", *row[0])
