"""Export: what firmware computes is what the project's own correction gives."""

import io
import re
import struct
import zlib
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml
from c_compiler import FIXED, REAL, compiled
from each import each
from numpy.typing import NDArray

from pipelines.archive import Run
from pipelines.export import ExportSettings, UnitCalibration, device_ids, export_files, unit_calibrations
from pipelines.export.fixed_point import fixed_point
from pipelines.export.polynomials import ORDER, effects_left_out
from pipelines.export.unit_noise import UnitNoise
from pipelines.importers.readers import matlab as matlab_reader
from schemas.errors import WrongUse


def export_text(name: str, units: list[UnitCalibration], run: str, settings: ExportSettings | None = None) -> str:
    """The calibrations in a format of text, the files of several units one after another."""
    return b"".join(export_files(name, units, run, settings).values()).decode()


def test_refuses_a_unit_that_is_not_there_an_effect_without_a_place_and_noise_without_a_static_record(
    run: Run,
) -> None:
    with pytest.raises(WrongUse, match="no unit B7 in this run; known: A1, A2, A3"):
        unit_calibrations(run, ("B7",), failed=False)
    bent = replace(unit(), left_out=effects_left_out(SimpleNamespace(effects=("bias", "second_order"))))
    with pytest.raises(WrongUse, match="effect second_order has no place"):
        export_text("px4", [bent], run.id)
    with pytest.raises(WrongUse, match=r"no noise terms of unit SN 1.*an import has none; 'tumbleline noise allan"):
        export_text("kalibr", [replace(unit(), noise=None)], "run-1")


Array = NDArray[np.float64]
G = 9.80665
NOMINAL = 256000.0
IDS = ExportSettings(nominal=NOMINAL, device_ids={"SN 1": 1310988})


def unit(*, across: float = 3e-3, scale_t: float = 1e-4, low: float = -10.0, high: float = 60.0) -> UnitCalibration:
    """A calibration like that of an ADXL355: 20 mg of bias, 50 µg/K, 100 ppm/K, 3 mrad."""
    rng = np.random.default_rng(4)
    bias, response = np.zeros((ORDER, 3)), np.zeros((ORDER, 3, 3))
    bias[0] = NOMINAL * np.array([0.02, -0.013, 0.031])
    bias[1] = NOMINAL * np.array([5e-5, -3e-5, 8e-5])
    bias[2] = NOMINAL * np.array([2e-7, 1e-7, -3e-7])
    bias[3] = NOMINAL * np.array([1e-9, -2e-9, 3e-9])
    response[0] = NOMINAL * (np.diag([1.004, 0.997, 1.011]) + across * rng.normal(size=(3, 3)) * (1.0 - np.eye(3)))
    response[1] = NOMINAL * scale_t * np.diag([1.0, -0.5, 0.7])
    value = {"N": np.array([15.9, 14.0, 12.0]), "B": np.array([6.0, 5.0, 4.0]), "K": np.array([0.3, 0.2, 0.1])}
    known = {s: np.array([True, True, s != "K"]) for s in value}
    noise = UnitNoise(value, known, 100.0)
    return UnitCalibration("SN 1", "pass", "industrial", "LSB", bias, response, (low, high), (), None, noise, 524287.0)


def readings(c: UnitCalibration, n: int = 200, size: float = 1.0) -> list[tuple[Array, float, Array]]:
    """Forces of this size, g, in any direction, temperatures in the measured range, and the outputs of the unit there."""
    rng = np.random.default_rng(11)
    points = []
    for t in rng.uniform(*c.temperatures, n):
        force = rng.normal(size=3)
        force *= size / np.linalg.norm(force)
        theta = t - 25.0
        b = sum(c.bias[k] * theta**k for k in range(ORDER))
        m = sum(c.response[k] * theta**k for k in range(ORDER))
        points.append((force, float(t), b + m @ force))
    return points


def stated_ug(text: str) -> float:
    """The largest error that a file states."""
    match = re.search(r"at 1 g: ([\d.e+-]+) [µu]g", text)
    return float(match[1])


def px4(parameters: dict[str, float], raw: Array, t: float, device: int, n: int = 0) -> Array:
    """PX4: src/lib/sensor_calibration (Accelerometer.cpp), temperature_compensation of the sensors."""
    if parameters.get(f"CAL_ACC{n}_ID") != device or parameters[f"CAL_ACC{n}_PRIO"] == 0:
        return raw
    thermal = np.zeros(3)
    if parameters.get("TC_A_ENABLE") == 1 and parameters.get(f"TC_A{n}_ID") == device:
        low, high = parameters[f"TC_A{n}_TMIN"], parameters[f"TC_A{n}_TMAX"]
        d = min(max(t, low), high) - parameters[f"TC_A{n}_TREF"]
        thermal = np.array([sum(parameters[f"TC_A{n}_X{k}_{i}"] * d**k for k in range(4)) for i in range(3)])
    offset = np.array([parameters[f"CAL_ACC{n}_{a}OFF"] for a in "XYZ"])
    scale = np.array([parameters[f"CAL_ACC{n}_{a}SCALE"] for a in "XYZ"])
    return (raw - thermal - offset) * scale


def qgroundcontrol(text: str) -> dict[str, float]:
    """QGroundControl's ParameterManager::readParametersFromStream: lines of five columns parted by tabs; # is a comment."""
    parameters: dict[str, float] = {}
    for line in text.splitlines():
        if line.startswith("#"):
            continue
        vehicle, component, name, value, kind = line.split("\t")
        assert (vehicle, component) == ("1", "1")
        assert len(name) <= 16  # MAVLink's length of a name
        parameters[name] = int(value) if kind == "6" else float(np.float32(value))
        assert kind in {"6", "9"}
    return parameters


def ardupilot(p: dict[str, float], raw: Array, t: float, n: int = 1) -> Array:
    """ArduPilot: AP_InertialSensor_tempcal.cpp (correct_accel) and AP_InertialSensor_Backend.cpp (offset, scale)."""
    mid = "" if n == 1 else str(n)

    def polynomial(x: float) -> Array:
        return 1e-6 * np.array([sum(p[f"INS_TCAL{n}_ACC{k}_{a}"] * x**k for k in (1, 2, 3)) for a in "XYZ"])

    if p.get(f"INS_TCAL{n}_ENABLE") == 1:
        low, high = p[f"INS_TCAL{n}_TMIN"], p[f"INS_TCAL{n}_TMAX"]
        assert high - low >= 10.0
        at, cal = (min(max(v, low), high) for v in (t, p[f"INS_ACC{n}_CALTEMP"]))
        raw = raw - polynomial(at - 35.0) + polynomial(cal - 35.0)
    offset = np.array([p[f"INS_ACC{mid}OFFS_{a}"] for a in "XYZ"])
    scale = np.array([p[f"INS_ACC{mid}SCAL_{a}"] for a in "XYZ"])
    return (raw - offset) * scale


def named_values(text: str) -> dict[str, float]:
    lines = [line.split(",") for line in text.splitlines() if not line.startswith("#")]
    assert all(len(name) <= 16 for name, _ in lines)
    return {name: float(np.float32(value)) for name, value in lines}


def left_ug(name: str, text: str, c: UnitCalibration, sensor: int = 0) -> float:
    """The largest error, µg, that an autopilot leaves in readings of its sensor with this number."""
    if name == "px4":
        flown = partial(px4, qgroundcontrol(text), device=1310988, n=sensor)
    else:
        flown = partial(ardupilot, named_values(text), n=sensor + 1)
    errors = [flown(raw=G * y / NOMINAL, t=t) / G - f for f, t, y in readings(c, 2000)]
    return float(1e6 * np.max(np.abs(errors)))


@each([("px4", -10.0, 60.0, 0), ("px4", -10.0, 60.0, 2), ("ardupilot", -10.0, 60.0, 0), ("ardupilot", 30.0, 70.0, 0),
       ("ardupilot", -40.0, 10.0, 2)])  # fmt: skip
def test_an_autopilot_applies_bias_scale_and_the_bias_over_temperature(row: tuple[str, float, float, int]) -> None:
    name, low, high, sensor = row
    c = unit(across=0.0, scale_t=0.0, low=low, high=high)
    text = export_text(name, [c], "run-1", replace(IDS, sensor=sensor))
    assert left_ug(name, text, c, sensor) < 0.5
    if name == "px4":
        assert stated_ug(text) < 0.5
    else:
        number = "" if sensor == 0 else sensor + 1
        assert named_values(text)[f"INS_ACC{number}_ID"] == pytest.approx(1310988)


@each(["px4", "ardupilot"])
def test_an_autopilot_leaves_what_its_file_says_and_not_more(name: str) -> None:
    c = unit()
    text = export_text(name, [c], "run-1", IDS)
    assert 0.7 * stated_ug(text) < left_ug(name, text, c) < 1.05 * stated_ug(text)
    assert "not in this file: misalignment, up to" in text
    assert "not in this file: temperature dependence of the scale, up to" in text


def test_ardupilot_gets_no_temperature_terms_over_less_than_10_k_and_says_what_that_costs() -> None:
    text = export_text("ardupilot", [unit(across=0.0, scale_t=0.0, low=20.0, high=28.0)], "run-1", IDS)
    assert "TCAL" not in text
    assert "temperature dependence of the bias, up to" in text
    assert stated_ug(text) == pytest.approx(8e-5 * 5e6, rel=0.1)  # 80 µg/K over 5 K, and a little curvature


def test_betaflight_subtracts_whole_counts() -> None:
    c = unit()
    text = export_text("betaflight", [c], "run-1", replace(IDS, counts_per_g=2048))
    match = re.search(r"^set acc_calibration = (-?\d+),(-?\d+),(-?\d+),1$", text, re.MULTILINE)
    trim = np.array([int(v) for v in match.groups()])
    assert np.max(np.abs(trim / 2048 - c.bias[0] / NOMINAL)) <= 0.5 / 2048
    errors = [(y / NOMINAL * 2048 - trim) / 2048 - f for f, _, y in readings(c, 2000)]
    assert 0.7 * stated_ug(text) < 1e6 * np.max(np.abs(errors)) < 1.05 * stated_ug(text)


def test_kalibr_gets_the_two_sided_density_of_the_noisiest_axis() -> None:
    """22.5 µg/√Hz on a data sheet is N = 15.9 µg/√Hz: 1.56e-4, not 2.21e-4 m/s²/√Hz (facts, E7)."""
    file = yaml.safe_load(export_text("kalibr", [unit()], "run-1", replace(IDS, rate_hz=200.0)))
    assert file["accelerometer_noise_density"] == pytest.approx(1.56e-4, rel=2e-3)
    assert file["accelerometer_random_walk"] == pytest.approx(0.3e-6 * G)
    assert file["update_rate"] == 200.0
    # Kalibr's own discretisation (kalibr wiki, IMU noise model): σ_d = σ/√Δt; the record's sample has N·√rate
    assert file["accelerometer_noise_density"] * np.sqrt(200.0) == pytest.approx(15.9e-6 * G * np.sqrt(200.0))


def test_ros_gets_lists_by_axis_whose_processes_have_the_allan_deviation_of_b() -> None:
    text = export_text("ros", [unit()], "run-1")
    file = yaml.safe_load(text)["/**"]["ros__parameters"]
    np.testing.assert_allclose(file["accelerometer_noise_density"], 1e-6 * G * np.array([15.9, 14.0, 12.0]), rtol=1e-6)
    assert "K: upper limit (95 %), not identified: z" in text
    t = np.array(file["accelerometer_bias_correlation_times"])
    sigma = np.array(file["accelerometer_bias_sigmas_x"])
    for tau in (1.0, 10.0, 100.0, 1000.0):
        one = 2 * sigma**2 * t / tau * (1 - t / (2 * tau) * (3 - 4 * np.exp(-tau / t) + np.exp(-2 * tau / t)))
        assert np.sqrt(one.sum()) == pytest.approx(0.664 * 6e-6 * G, rel=0.03)
    covariance = np.array(file["linear_acceleration_covariance"]).reshape(3, 3)
    np.testing.assert_allclose(np.diag(covariance), (1e-6 * G * np.array([15.9, 14.0, 12.0])) ** 2 * 100.0, rtol=1e-6)


def test_matlab_reads_the_properties_of_accelparams() -> None:
    """Read by this project's own reader of the format; the sensor by the documentation of imuSensor (Algorithms)."""
    c = unit(across=3e-3)
    content = export_files("matlab", [c], "run-1", IDS)["calibration.mat"]
    table = matlab_reader.read("calibration.mat", content, "").table
    from scipy.io import loadmat

    p = loadmat(io.BytesIO(content), squeeze_me=True, struct_as_record=False)["SN_1"]
    remark = str(loadmat(io.BytesIO(content), squeeze_me=True, struct_as_record=False)["tumbleline"].remarks)
    assert not table.empty
    assert np.array_equal(np.diag(p.AxesMisalignment), [100.0] * 3)
    errors = []
    for f, t, y in readings(c, 1000):
        sensor = p.AxesMisalignment / 100.0 @ (G * f) + p.ConstantBias + (t - 25.0) * p.TemperatureBias
        sensor *= 1.0 + (t - 25.0) / 100.0 * p.TemperatureScaleFactor
        errors.append((sensor - G * y / NOMINAL) / G)
    assert 0.5 * stated_ug(remark) < 1e6 * np.max(np.abs(errors)) < 1.1 * stated_ug(remark)  # no scale at 25 °C
    np.testing.assert_allclose(p.NoiseDensity, 1e-6 * G * np.array([15.9, 14.0, 12.0]))
    assert p.MeasurementRange == pytest.approx(G * 524287.0 / NOMINAL)


def off(c: UnitCalibration, header: str, call: str, points: list[tuple[Array, float, Array]], folder: Path) -> float:
    """The largest difference, g, of what a compiled header computes from the calibration."""
    rows = np.array([(*np.rint(y), np.round(t, 3)) for _, t, y in points])
    wanted = np.array([c.correct(np.array([row[:3]]), row[3])[0] for row in rows])
    return float(np.max(np.abs(compiled(header, call, rows, folder) - wanted)))


@pytest.mark.parametrize(
    ("arithmetic", "call", "within"),
    [("double", REAL.replace("REAL", "double"), 1e-12), ("float", REAL.replace("REAL", "float"), 1e-6), ("q24", FIXED, 1e-6)],
)  # fmt: skip
def test_compiled_c_computes_the_calibration(arithmetic: str, call: str, within: float, tmp_path: Path) -> None:
    c = unit()
    alike = replace(c, unit="correct")  # has the name of a function of the header
    header = export_text("c", [c, alike], "run-1", ExportSettings(arithmetic=arithmetic))
    if arithmetic == "double":  # its check is the CRC of zlib
        stated = int(re.findall(r"0x([0-9A-F]{8})u\n\}", header)[0], 16)
        values = [*c.temperatures, *c.bias.ravel(), *c.response.ravel()]
        assert stated == zlib.crc32(b"SN 1" + struct.pack(f"<{len(values)}d", *values))
    largest = off(c, header, call, readings(c, 500), tmp_path)
    assert largest < within
    assert arithmetic != "q24" or largest < 1.5e-6 * stated_ug(header) + 2e-7


@pytest.mark.parametrize("axes", [(0,), (0, 1)])
def test_fixed_point_of_fewer_axes_has_their_scale_and_takes_forces_for_the_others(axes: tuple[int, ...]) -> None:
    c = unit(scale_t=1e-3, across=3e-3)
    own = replace(c, bias=c.bias[:, list(axes)], response=c.response[:, list(axes)], axes=axes)
    made, whole = fixed_point(own), own.with_every_axis
    assert made.scale == pytest.approx(np.mean(np.diag(c.response[0])[list(axes)]))
    assert made.of_forces.tolist() == [axis not in axes for axis in range(3)]
    for f, t, y in readings(c, 200):
        output = np.where(made.of_forces, f, y)[None]
        temperature = float(np.clip(np.round(t, 3), *c.temperatures))
        assert np.abs(made.correct(output, temperature) - whole.correct(output, temperature)).max() < 1e-6


def test_compiled_fixed_point_beyond_its_temperatures_and_128_g_holds_the_nearest_one(tmp_path: Path) -> None:
    """The program of the test ends with 4 where the function does not tell that the temperature was beyond the range."""
    c = unit(scale_t=1e-3)
    header = export_text("c", [c], "run-1", ExportSettings(arithmetic="q24"))
    output = NOMINAL * np.array([7.5, -6.0, 8.0])
    rows = np.array([(*output, t) for t in (-10.0, -10.001, -60.0, 60.0, 60.001, 125.0)])
    computed = compiled(header, FIXED, rows, tmp_path)
    assert np.array_equal(computed[:3], np.repeat(computed[:1], 3, axis=0))
    assert np.array_equal(computed[3:], np.repeat(computed[3:4], 3, axis=0))
    edges = np.array([c.correct(output[None], t)[0] for t in c.temperatures])
    assert np.max(np.abs(computed[[0, 3]] - edges)) < 8.0 * (1e-6 * stated_ug(header) + 2e-7)
    (far,) = compiled(header, FIXED, np.array([(2.0**31 - 1.0, -(2.0**31), 0.0, 20.0)]), tmp_path)
    assert far[:2] == pytest.approx([128.0, -128.0], rel=0.02)  # and not of the other sign


@pytest.mark.parametrize("full_scale", [2.0, 8.0])
def test_fixed_point_states_its_error_at_full_scale_and_keeps_it(full_scale: float, tmp_path: Path) -> None:
    c = replace(unit(scale_t=1e-3, low=-40.0, high=85.0), full_scale=full_scale * NOMINAL)
    header = export_text("c", [c], "run-1", ExportSettings(arithmetic="q24"))
    match = re.search(r"from -40 to 85 degrees Celsius, .*at full scale \(([\d.]+) g\): ([\d.e+-]+) ug", header)
    size, stated = float(match[1]), float(match[2])
    assert size == pytest.approx(full_scale, rel=0.02)
    worst = 1e6 * off(c, header, FIXED, readings(c, 2000, size), tmp_path)
    assert 0.5 * stated < worst < 1.2 * stated + 0.2


def test_device_ids_are_one_for_each_unit_and_px4_needs_the_one_that_it_compares() -> None:
    assert device_ids("1310988", ["A"]) == {"A": 1310988}
    assert device_ids("A=0x140, B=2", ["A", "B"]) == {"A": 320, "B": 2}
    for text, units in (("7", "AB"), ("A=1,B=1", "AB"), ("C=1", "A"), ("-1", "A"), ("x", "A")):
        with pytest.raises(WrongUse, match="--set device_id"):
            device_ids(text, [*units])
    with pytest.raises(WrongUse, match=r"no device id of unit SN 1.*--set device_id=SN 1=ID"):
        export_text("px4", [unit()], "run-1", ExportSettings(nominal=NOMINAL))
    ignored = px4(qgroundcontrol(export_text("px4", [unit()], "r", IDS)), np.ones(3), 25.0, 99)
    assert np.array_equal(ignored, np.ones(3))


def test_files_of_units_are_parted_and_never_share_a_name() -> None:
    one, other = unit(), replace(unit(), unit="SN_1")
    ids = ExportSettings(nominal=NOMINAL, device_ids={"SN 1": 1, "SN_1": 2})
    with pytest.raises(WrongUse, match="two units have the file name"):
        export_files("px4", [one, other], "r", ids)
    for form, language in (("matlab", "MATLAB"), ("c", "C")):
        with pytest.raises(WrongUse, match=f"both SN_1 in {language}, "):
            export_files(form, [one, other], "r", ids)


def polynomials(force: Array, t: Array | None = None) -> tuple[pd.DataFrame, Array]:
    """The exported polynomials of a bent unit that was measured at these forces (n, 3), and its outputs."""
    own = force - 2e-3 * force**2 + 1e-3 * force**3
    output = NOMINAL * (0.01 + 1.003 * own + (0.0 if t is None else 5e-5 * (t - 25.0)[:, None]))
    columns = [f"{name}_{axis}" for name in ("force", "out") for axis in "xyz"]
    dwells = pd.DataFrame(np.hstack([force, output]), columns=columns)
    dwells = dwells if t is None else dwells.assign(unit_C=t)
    (content,) = export_files("polynomial", [replace(unit(), dwells=dwells)], "run-1", ExportSettings()).values()
    return pd.read_csv(io.BytesIO(content)), output


@each([((-1.0, -0.5, 0.0, 0.5, 1.0), 3), ((-1.0, 0.0, 1.0), 2)])
def test_a_polynomial_of_each_axis_gives_the_force_back_with_the_powers_that_its_levels_allow(
    row: tuple[tuple[float, ...], int],
) -> None:
    levels, powers = row
    force = np.vstack([level * np.eye(3)[k] for k in range(3) for level in levels for _ in range(6)])
    t = np.random.default_rng(3).uniform(-20.0, 60.0, len(force))
    table, output = polynomials(force, t)
    assert table["axis"].tolist() == ["x", "y", "z"]
    assert table[[f"c{k}" for k in range(4)]].notna().sum(axis=1).tolist() == [powers + 1] * 3
    for k, one in enumerate(table.to_dict("records")):
        terms = [one[f"c{p}"] * output[:, k] ** p for p in range(powers + 1)]
        left = np.sum(terms, axis=0) + one["kT"] * (t - one["T0_C"]) - force[:, k]
        assert np.abs(left).max() < 2e-4  # kT has no place for the product of temperature and nonlinearity
        assert one["rms_ug"] == pytest.approx(1e6 * np.sqrt(np.mean(left**2)), rel=1e-3, abs=1e-3)


def test_many_poses_allow_every_power_of_a_polynomial() -> None:
    force = np.random.default_rng(8).normal(size=(400, 3))
    table, _ = polynomials(force / np.linalg.norm(force, axis=1, keepdims=True))
    assert table["c3"].notna().all()
    assert (table["rms_ug"] < 20.0).all()
