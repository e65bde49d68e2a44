"""Quantiles and tails by scipy.special are those of scipy.stats; a record's commands do not load the slow library."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
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


@pytest.mark.parametrize("dof", [0.0, -1.0, np.nan])
def test_without_degrees_of_freedom_there_is_no_probability(dof: float) -> None:
    assert np.isnan(own.chi2_tail(1.0, dof))
    assert np.isnan(own.chi2_quantile(0.5, dof))
    assert np.isnan(own.chi2_upper(0.5, dof))


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
