"""TEDS of a sweep: sensitivity at its reference frequency, and a transfer function where one pole and one resonance hold it."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pandas as pd
import pytest

from pipelines.archive import Run
from pipelines.export.swept_teds import is_sweep, swept_axis, swept_files
from pipelines.export.teds import DataSheet
from schemas.errors import WrongUse

G = 9.80665
SHEET = DataSheet(17, 4507, "B5", 4.6, "QA", "2026-05-01", 365)
SCALE = 0.1  # V per g


def points(frequency: Any, h: Any, temperature: float = 24.2, unit: str = "SN7", seed: int = 1) -> pd.DataFrame:
    """A sweep with errors of 0.1 % and 0.06°."""
    rng = np.random.default_rng(seed)
    n = len(frequency)
    noisy = h * (1.0 + 1e-3 * rng.standard_normal(n)) * np.exp(1j * np.radians(0.06) * rng.standard_normal(n))
    return pd.DataFrame(
        {
            "unit": unit, "axis": "z", "procedure": "sweep", "series": "response", "setting": frequency,
            "value": SCALE * np.abs(noisy), "uncertainty": 1e-3 * SCALE * np.abs(noisy),
            "phase_deg": np.degrees(np.angle(noisy)), "phase_uncertainty_deg": 0.06, "level_g": 1.0,
            "temperature_C": temperature, "record_s": 0.1,
        }
    )  # fmt: skip


def resonant(f: Any, natural: float = 4000.0, quality: float = 30.0, pole: float = 12000.0) -> Any:
    """A piezoelectric accelerometer with an amplifier of one pole."""
    r = f / natural
    return 1.0 / (1.0 - r**2 + 1j * r / quality) / (1.0 + 1j * f / pole)


F = np.geomspace(20.0, 9000.0, 24)


@pytest.mark.slow
def test_sensitivity_is_that_at_the_reference_frequency_with_its_sign_and_the_resonance_is_stated() -> None:
    one, lines = swept_axis("SN7", points(F, resonant(F)), 2)
    at = F[np.argmin(np.abs(np.log(F / 160.0)))]
    assert one.reference_hz == pytest.approx(at)
    assert one.reference_C == 24.2
    assert one.sensitivity == pytest.approx(SCALE * abs(resonant(at)) / G, rel=4e-3)
    assert one.transfer.resonance_hz == pytest.approx(4000.0, rel=0.011)
    assert one.transfer.quality == pytest.approx(30.0, rel=0.02)
    assert one.transfer.pole_hz == pytest.approx(12000.0, rel=0.06)
    assert lines[1].startswith("transfer function: low-pass")
    one, _ = swept_axis("SN7", points(F, -resonant(F)), 2)
    assert one.sensitivity < 0.0


@pytest.mark.slow
def test_a_response_that_the_template_cannot_hold_has_no_transfer_function_and_the_text_says_why() -> None:
    r = F / 960.0
    h = resonant(F, 2200.0, 0.8, 1e6) / (1.0 - r**2 + 1j * np.sqrt(2.0) * r)
    one, lines = swept_axis("SN7", points(F, h), 2)
    assert one.transfer is None
    assert lines[1].startswith("no transfer function: one pole and one resonance do not describe the points")
    low = F[F < 1500.0]
    one, lines = swept_axis("SN7", points(low, resonant(low)), 2)
    assert one.transfer is None


def test_of_a_sweep_in_several_states_the_one_at_room_temperature_in_the_room_is_taken() -> None:
    warm = points(F, 1.1 * resonant(F), 80.0)
    thin = points(F, 1.2 * resonant(F)).assign(pressure_hPa=300.0)
    room = points(F, resonant(F))
    one, _ = swept_axis("SN7", pd.concat([warm, thin, room], ignore_index=True), 2)
    at = F[np.argmin(np.abs(np.log(F / 160.0)))]
    assert one.sensitivity == pytest.approx(SCALE * abs(resonant(at)) / G, rel=4e-3)
    with pytest.raises(WrongUse, match="has 0 points of a sweep at 15 to 30 °C in the air of the room, 8 are needed"):
        swept_axis("SN7", warm, 2)


@dataclass
class Measured:
    """What the export reads of a run."""

    rows: pd.DataFrame
    out_unit: str = "V"
    id: str = "sweep-1"
    records: None = None

    @property
    def about(self) -> dict[str, Any]:
        return {"recipe": {"procedures": [{"kind": "sweep"}]}}

    def table(self, name: str) -> pd.DataFrame:
        units = sorted(set(self.rows["unit"]))
        grades = pd.DataFrame({"unit": units, "outcome": "pass", "grade": "none", "reasons": ""})
        readings = pd.DataFrame({"unit": units, "out_unit": self.out_unit})
        return {"procedure_points": self.rows, "grades": grades, "readings": readings}[name]


def files_of(run: Measured, monkeypatch: pytest.MonkeyPatch) -> dict[str, bytes]:
    monkeypatch.setattr("pipelines.export.polynomials.stated", lambda *_: {})
    return swept_files(cast("Run", run), (), SHEET, failed=False)


def test_a_unit_has_a_page_for_its_axis_and_a_text(monkeypatch: pytest.MonkeyPatch) -> None:
    run = Measured(pd.concat([points(F, resonant(F)), points(F, resonant(F), unit="SN8")]))
    assert is_sweep(cast("Run", run))
    made = files_of(run, monkeypatch)
    assert sorted(made) == ["SN7-z.teds", "SN7.txt", "SN8-z.teds", "SN8.txt"]
    assert all(len(made[name]) == 32 and sum(made[name]) % 256 == 0 for name in made if name.endswith(".teds"))
    assert "period 365 days" in made["SN7.txt"].decode()


def test_digital_outputs_and_equal_digits_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(WrongUse, match="in LSB, V is needed"):
        files_of(Measured(points(F, resonant(F)), "LSB"), monkeypatch)
    twice = pd.concat([points(F, resonant(F)), points(F, resonant(F), unit="A7")])
    with pytest.raises(WrongUse, match="units A7 and SN7: TEDS hold the digits"):
        files_of(Measured(twice), monkeypatch)
