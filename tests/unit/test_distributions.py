"""Quantiles and tails by scipy.special are those of scipy.stats; a record's commands do not load the slow library."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lots import lot
from scipy import signal, stats

from inertial import distributions as own
from inertial.noise.psd import one_sided

DOF = np.array([0.3, 1.0, 2.5, 17.0, 300.0, 1e6])
PROBABILITY = np.array([1e-12, 1e-4, 0.025, 0.5, 0.975, 1.0 - 1e-6])[:, None]


def test_quantiles_are_those_of_scipy_stats() -> None:
    np.testing.assert_allclose(own.chi2_quantile(PROBABILITY, DOF), stats.chi2.ppf(PROBABILITY, DOF), rtol=1e-12)
    np.testing.assert_allclose(own.chi2_upper(PROBABILITY, DOF), stats.chi2.isf(PROBABILITY, DOF), rtol=1e-12)
    np.testing.assert_allclose(own.normal_upper(PROBABILITY), stats.norm.isf(PROBABILITY), rtol=1e-12)


def test_tails_are_those_of_scipy_stats() -> None:
    value = np.array([-1.0, 0.0, 1e-6, 1.0, 30.0, 400.0])[:, None]
    np.testing.assert_allclose(own.chi2_tail(value, DOF), stats.chi2.sf(value, DOF), rtol=1e-12)


def test_tails_of_f_and_t_are_those_of_scipy_stats() -> None:
    value, second = np.array([-1.0, 0.0, 1e-3, 0.7, 1.0, 4.0, 80.0])[:, None], np.array([1.0, 9.0, 400.0, 1e6])
    for first in (0.5, 1.0, 3.0, 700.0):
        np.testing.assert_allclose(own.f_tail(value, first, second), stats.f.sf(value, first, second), rtol=1e-12)
        small = np.array([1e-6, 1e-3, 0.5])[:, None]
        np.testing.assert_allclose(own.f_upper(small, first, second), stats.f.isf(small, first, second), rtol=1e-12)
    np.testing.assert_allclose(own.student_tail(value, DOF), stats.t.sf(value, DOF), rtol=1e-12)
    np.testing.assert_allclose(own.student_upper(PROBABILITY, DOF), stats.t.isf(PROBABILITY, DOF), rtol=1e-12)
    np.testing.assert_allclose(own.normal_tail(value), stats.norm.sf(value), rtol=1e-12)


def test_tails_of_noncentral_f_are_those_of_scipy_stats() -> None:
    value, away = np.array([0.2, 1.0, 3.0, 12.0])[:, None], np.array([0.01, 0.5, 7.0, 200.0])
    for first, second in ((1.0, 5.0), (3.0, 60.0), (24.0, 5000.0)):
        expected = stats.ncf.sf(value, first, second, away)
        np.testing.assert_allclose(own.noncentral_f_tail(value, first, second, away), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("size", [8, 20, 60, 500, 50_000])
def test_the_test_of_kurtosis_is_that_of_scipy_stats(size: int) -> None:
    rng = np.random.default_rng(63)
    for values in (rng.standard_normal(size), rng.standard_t(4, size), rng.uniform(2.0, 3.0, size)):
        expected = float(stats.kurtosistest(values, alternative="greater").pvalue)
        assert own.kurtosis_tail(values) == pytest.approx(expected, rel=1e-10, abs=1e-300)


@pytest.mark.parametrize("dof", [0.0, -1.0, np.nan])
def test_without_degrees_of_freedom_there_is_no_probability(dof: float) -> None:
    assert np.isnan(own.chi2_tail(1.0, dof))
    assert np.isnan(own.chi2_quantile(0.5, dof))
    assert np.isnan(own.chi2_upper(0.5, dof))
    assert np.isnan(own.f_tail(1.0, dof, 3.0))
    assert np.isnan(own.f_tail(1.0, 3.0, dof))
    assert np.isnan(own.f_upper(0.5, 3.0, dof))
    assert np.isnan(own.student_tail(1.0, dof))
    assert np.isnan(own.student_upper(0.5, dof))


@pytest.mark.parametrize(("count", "segment"), [(1000, 125), (1001, 124), (64, 64), (500, 333)])
def test_the_spectrum_is_that_of_scipy_signal(count: int, segment: int) -> None:
    x = np.random.default_rng(61).normal(3.0, 2.0, (2, count))
    frequency, density = signal.welch(x, fs=50.0, nperseg=segment, detrend="constant")
    spectrum = one_sided(x, 50.0, segment=segment)
    np.testing.assert_allclose(spectrum.frequency, frequency, rtol=1e-12)
    np.testing.assert_allclose(spectrum.density, density, rtol=1e-9, atol=1e-14)


LOADED = """
import sys
from pipelines.cli import main
try:
    main()
except SystemExit as left:
    print(left.code or 0, *sys.modules, file=sys.stderr)
"""


@pytest.mark.parametrize("command", ["allan", "psd"])
def test_the_commands_of_a_record_load_no_library_that_they_do_not_need(command: str, tmp_path: Path) -> None:
    record = tmp_path / "rest.csv"
    values = np.random.default_rng(62).normal(0.0, 1e-3, (2000, 3))
    np.savetxt(record, values, fmt="%.7f", delimiter=",", header="x,y,z", comments="")
    done = subprocess.run(
        [sys.executable, "-c", LOADED, command, str(record), "--rate", "100"],
        capture_output=True,
        text=True,
        check=True,
    )
    status, *loaded = done.stderr.split()[-3000:]
    assert status == "0"
    assert "numpy" in loaded
    assert not set(loaded) & {"scipy.stats", "scipy.signal", "pandera", "matplotlib"}


def test_a_diagnosis_loads_no_library_that_it_does_not_need(tmp_path: Path) -> None:
    path = tmp_path / "dwells.csv"
    lot(np.random.default_rng(64), units=2).to_csv(path, index=False)
    done = subprocess.run(
        [sys.executable, "-c", LOADED, "diagnose", str(path), "--json"], capture_output=True, text=True, check=True
    )
    status, *loaded = done.stderr.split()[-3000:]
    assert status in {"0", "1"}
    assert "scipy.linalg" in loaded
    assert not set(loaded) & {"scipy.stats", "scipy.optimize", "scipy.sparse", "scipy.signal", "matplotlib"}


@pytest.mark.parametrize("noncentrality", [1e3, 1e5, 1e6, 1e8, 1e12])
@pytest.mark.parametrize("dof", [10, 105, 500])
def test_a_large_noncentrality_is_exceeded_for_certain(noncentrality: float, dof: int) -> None:
    # of a plan without much noise: the smallest detected cubic was no number, and the diagnosis ended with a defect
    tail = float(own.noncentral_f_tail(2.5, 24, dof, noncentrality))
    assert tail == pytest.approx(1.0, abs=1e-6)
    assert np.isnan(own.noncentral_f_tail(2.5, 24, dof, np.nan))
