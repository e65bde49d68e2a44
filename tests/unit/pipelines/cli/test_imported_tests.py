"""Recordings of dynamic tests by the command that a user types: what is printed, and with which status it ends."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from each import each
from in_process import document_of, refused, text_of
from scipy import signal

from pipelines.archive import Archive

RATE_HZ, SIZE = 50_000.0, 4000
TIME = np.arange(SIZE) / RATE_HZ
SCALE = 0.0072


def half_sine(peak_g: float = 30.0, begins_s: float = 0.02, duration_s: float = 0.006) -> np.ndarray:
    inside = (begins_s <= TIME) & (begins_s + duration_s > TIME)
    return np.where(inside, peak_g * np.sin(np.pi * (TIME - begins_s) / duration_s), 0.0)


def felt(force: np.ndarray, natural_hz: float = 1500.0, damping: float = 0.62) -> np.ndarray:
    w = 2.0 * np.pi * natural_hz
    return signal.lsim(([w**2], [1.0, 2.0 * damping * w, w**2]), force, TIME)[1]


def recorded(
    folder: Path, kind: str, reference: np.ndarray, output: np.ndarray, unit: str, noise: float, *more: str
) -> tuple[str, ...]:
    """The words of the import of a test with noise on both channels."""
    rng, path = np.random.default_rng(1), folder / f"{kind}.csv"
    both = output + 2e-4 * rng.standard_normal(SIZE), reference + noise * rng.standard_normal(SIZE)
    np.savetxt(path, np.c_[TIME, *both], fmt="%.9g", delimiter=",", header="time_s,DUT_V,REF", comments="")
    mapped = ("--map", "time=time_s,z=DUT_V,reference=REF", "--unit-of", f"output=V,reference={unit}")
    archive = ("--units", "SN1", "--archive", str(folder / "archive"))
    return ("import", str(path), "--procedure", kind, *more, *mapped, *archive)


def shock(folder: Path, reference: np.ndarray, output: np.ndarray) -> tuple[str, ...]:
    (folder / "part.toml").write_text(f"scale = {SCALE}\n")
    return recorded(folder, "shock", reference, output, "g", 0.02, "--set", str(folder / "part.toml"))


def step(folder: Path, drive: np.ndarray, output: np.ndarray) -> tuple[str, ...]:
    return recorded(folder, "step_response", drive, output, "V", 0.002)


def test_a_figure_that_a_file_cannot_hold_is_said_once_and_fails_nothing(tmp_path: Path) -> None:
    words = shock(tmp_path, half_sine(), SCALE * felt(half_sine()))
    text = text_of(*words, status=0)
    assert text.count("shock_bias_shift_ug") == 1
    assert "not measured: shock_bias_shift_ug: no record at rest before and after the shocks" in text
    document = document_of(*words, status=0)
    assert document["verdict"] == "adequate"
    assert [one["figure"] for one in document["figures"] if not one["measured"]] == ["shock_bias_shift_ug"]
    for command in ("diagnose", "fit", "export"):  # none leads to a fit
        assert "a dynamic test was imported" in (told := refused(command, document["run"], *words[-2:]))
        assert f"tumbleline show {document['run']} procedure_figures" in told
        assert "'tumbleline fit" not in told


AT = np.arange(SIZE)
EARLY = half_sine(12.0, 0.015) + half_sine(30.0, 0.05)
FLAWS: dict[str, Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]] = {  # of reference and output
    "missing effect: zero_shift": lambda r, o: (r, o + 0.15 * SCALE * np.clip(np.cumsum(r) / r.sum(), 0.0, 1.0)),
    "its sign is turned over; CANNOT BE JUDGED": lambda r, o: (r, -o),
    "12 g at 0.018 s; another pulse lies before the largest, in its baseline": lambda *_: (EARLY, SCALE * felt(EARLY)),
    "1 of 1 shocks clip the output": lambda r, o: (r, np.minimum(o, 0.93 * o.max())),
    "1 of 1 shocks clip the reference": lambda r, o: (np.minimum(r, 0.78 * r.max()), o),
    "a sample that departs alone, at 0.022 s": lambda r, o: (r, o + 0.3 * (AT == 1100) - 0.2 * (AT == 1101)),
}


@each(FLAWS)
def test_a_flaw_of_a_shock_is_told_and_fails(said: str, tmp_path: Path) -> None:
    text = text_of(*shock(tmp_path, *FLAWS[said](half_sine(), SCALE * felt(half_sine()))), status=1)
    assert [part for part in said.split("; ") if part not in text] == []


def test_a_recording_that_is_given_twice_and_a_pulse_of_a_few_samples_are_refused(tmp_path: Path) -> None:
    command, path, *words = shock(tmp_path, half_sine(), SCALE * felt(half_sine()))
    copy = tmp_path / "copy.csv"
    copy.write_bytes(Path(path).read_bytes())
    assert "copy.csv: the same bytes, each recording is needed once" in refused(command, path, copy, *words)
    assert not (tmp_path / "archive" / "runs").exists()
    shock(tmp_path, half_sine(duration_s=0.011), SCALE * half_sine(duration_s=0.011))
    head, *rows = Path(path).read_text().splitlines()
    Path(path).write_text("\n".join([head, *rows[::125]]))  # 400 Hz
    told = refused(command, path, *words)
    assert re.search(r"the pulse is no half sine: .* with 4 samples; look at the mounting, or sample faster", told)


def test_a_second_pulse_is_told_and_enters_no_figure(tmp_path: Path) -> None:
    twice = half_sine() + half_sine(18.0, 0.055)
    words = shock(tmp_path, twice, SCALE * felt(twice))
    assert "another pulse: 18 g at 0.058 s of record 1" in text_of(*words, status=0)
    figures = {one["figure"]: one["value"] for one in document_of(*words)["figures"]}
    assert figures["shock_return_ms"] < 1.0
    assert abs(figures["shock_zero_shift_percent"]) < 0.02


@each([(2.0, 0.0), (0.0, -2.0)])
def test_a_step_has_its_figures_whichever_way_it_goes(levels: tuple[float, float], tmp_path: Path) -> None:
    drive = np.where(TIME >= 0.02, levels[1], levels[0])
    words = step(tmp_path, drive, 0.05 * (levels[0] + felt(drive - levels[0], 900.0, 0.6)))
    figures = {one["figure"]: one for one in document_of(*words, status=0)["figures"]}
    overshoot = figures["step_overshoot_percent"]
    true = 100.0 * np.exp(-np.pi * 0.6 / 0.8)
    assert abs(overshoot["value"] - true) < 3.0 * overshoot["uncertainty"]


def test_a_flaw_of_a_step_is_told_and_fails(tmp_path: Path) -> None:
    drive = np.where(TIME >= 0.02, 2.0, 0.0)
    for damping, share in ((0.1, 0.3), (0.3, 0.6)):
        output = 0.05 * felt(drive, 900.0, damping)
        cut = np.minimum(output, 0.1 + share * (output.max() - 0.1))
        assert "the output is clipped; lower volts" in text_of(*step(tmp_path, drive, cut), status=1)
        assert "step_overshoot_percent z " in text_of(*step(tmp_path, drive, output))
    output[1500:1502] += 0.05, 0.03
    assert "a sample departs alone" in text_of(*step(tmp_path, drive, output), status=1)
    assert "one edge is needed; check the trigger" in refused(*step(tmp_path, np.ones(SIZE), np.zeros(SIZE)))


def sweep(folder: Path, head: str, *more: str, form: str = "", scatter: float = 1.0) -> tuple[str, ...]:
    """The words of the import of points of a sensor of 1500 Hz, a scale of 0.07 and a delay of 40 µs: 0.5 % and 0.3° a point.

    form : ``dB`` and ``rad`` for the units of the columns, ``-`` for the other polarity, ``u`` for columns of uncertainty
    """
    rng, f = np.random.default_rng(3), np.geomspace(5.0, 4000.0, 45)
    h = 0.07 / (1.0 - (f / 1500.0) ** 2 + 1.24j * f / 1500.0) * np.exp(-2j * np.pi * f * 40e-6)
    h = -h if "-" in form else h
    size = np.abs(h) * (1.0 + 0.005 * scatter * rng.standard_normal(f.size))
    angle = np.angle(h) + np.radians(0.3) * scatter * rng.standard_normal(f.size)
    own = [f, 20.0 * np.log10(size) if "dB" in form else size, angle if "rad" in form else np.degrees(angle)]
    own += [np.full(f.size, 0.5), np.full(f.size, np.radians(0.3) if "rad" in form else 0.3)] if "u" in form else []
    np.savetxt(folder / "points.csv", np.column_stack(own), fmt="%.9g", delimiter=",", header=head, comments="")
    words = ("import", str(folder / "points.csv"), "--procedure", "sweep", "--units", "SN1", *more)
    return (*words, "--archive", str(folder / "archive"))


OWN = "frequency_hz,magnitude,phase_deg,magnitude_uncertainty_percent,phase_uncertainty_deg"


def test_points_of_a_sweep_have_their_figures_with_u_and_the_polarity_in_the_text(tmp_path: Path) -> None:
    text = text_of(*sweep(tmp_path, OWN, form="u"), status=0)
    assert "figures: sensitivity 0.0700" in text
    for part in ("bandwidth 16", "natural frequency 1", "damping ratio 0.62", "polarity: positive"):
        assert part in text
    assert "without moving_average, one_pole, two_pole, which may make a part of it" in text
    assert "of the stated uncertainties" not in text
    turned = text_of(*sweep(tmp_path, OWN, form="u-"), status=0)
    assert "sensitivity −0.0700" in turned
    assert "the output is turned over: its phase at low frequency is π" in turned


def test_a_delay_beside_a_filter_that_may_be_absent_is_never_longer_than_both(tmp_path: Path) -> None:
    document = document_of(*sweep(tmp_path, OWN, form="u", scatter=0.15), status=0)
    delay, run = document["parameters"]["delay_s"], Archive(tmp_path / "archive").run(document["run"])
    assert len(run.table("procedure_points")) == 45
    archive = ("--archive", tmp_path / "archive")
    assert f"'tumbleline show {run.id} procedure_points'" in refused("diagnose", run.id, *archive)
    told = refused("certificate", "issue", run.id, *archive)
    assert "neither the uncertainty of the reference sensor nor limits" in told
    assert "it has procedure_findings, procedure_points" in refused("show", run.id, "dwells", *archive)
    assert run.about["source"]["sha256"]
    assert 0.0 < delay["low"] < 35e-6  # a filter of some kHz may make a part of it
    assert delay["high"] < 42e-6


def test_uncertainties_that_are_too_large_are_told_and_fail_nothing_and_too_small_ones_are_told(tmp_path: Path) -> None:
    assert "uncertainties: the scatter is 0.3" in text_of(*sweep(tmp_path, OWN, form="u", scatter=0.3), status=0)
    assert "stated uncertainties, in no order" in text_of(*sweep(tmp_path, OWN, form="u", scatter=10.0), status=1)


HEADS = [
    ("Frequency (Hz),Magnitude (dB),Phase (rad)", "dB rad", ()),
    ("frequency_hz,magnitude,phase", "dB rad", ("--unit-of", "magnitude=dB,phase=rad")),
    ("a,b,c", "", ("--map", "frequency=1,magnitude=2,phase=3", "--unit-of", "frequency=Hz,phase=deg")),
]


@each(HEADS)
def test_other_columns_and_units_are_recognised_or_stated(
    row: tuple[str, str, tuple[str, ...]], tmp_path: Path
) -> None:
    head, form, more = row
    part = tmp_path / "points.toml"
    part.write_text("repeatability_percent = 0.5\nrepeatability_deg = 0.3\n")
    text = text_of(*sweep(tmp_path, head, *more, "--set", str(part), form=form), status=0)
    assert "columns: frequency " in text
    assert "sensitivity 0.0700" in text


@pytest.mark.slow
def test_radians_that_are_called_degrees_are_told(tmp_path: Path) -> None:
    words = sweep(tmp_path, OWN, form="u rad")
    assert "add --unit-of phase=rad" in text_of(*words, status=1)
    text_of(*words, "--unit-of", "phase=rad,phase_uncertainty=rad", status=0)


def test_a_key_of_records_at_rest_or_of_waveforms_is_refused_for_points(tmp_path: Path) -> None:
    assert "--set face is for records at rest" in refused(*sweep(tmp_path, OWN, "--set", "face=+z", form="u"))
    part = tmp_path / "part.toml"
    part.write_text("stroke_mm = 5.0\n")
    assert "key stroke_mm is not for points" in refused(*sweep(tmp_path, OWN, "--set", str(part), form="u"))
