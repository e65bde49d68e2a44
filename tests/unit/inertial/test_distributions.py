"""Quantiles and tails are those of scipy.stats; a record's commands do not load the slow library."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from each import each
from long_suites import mostly_slow
from lots import lot
from scipy import stats

from inertial import distributions as own
from inertial.probability import log_chi2_tail, log_f_tail

DOF = np.array([0.3, 1.0, 2.5, 17.0, 300.0, 1e6])
PROBABILITY = np.array([1e-12, 1e-4, 0.025, 0.5, 0.975, 1.0 - 1e-6])[:, None]
VALUE = np.array([-1.0, 0.0, 1e-6, 1e-3, 0.7, 1.0, 4.0, 80.0, 400.0])[:, None]
SMALL = np.array([1e-6, 1e-3, 0.5])[:, None]
SECOND = np.array([1.0, 9.0, 400.0, 1e6])
FUNCTIONS = [
    (own.chi2_quantile, stats.chi2.ppf, PROBABILITY, (DOF,)),
    (own.chi2_upper, stats.chi2.isf, PROBABILITY, (DOF,)),
    (own.chi2_tail, stats.chi2.sf, VALUE, (DOF,)),
    (own.student_tail, stats.t.sf, VALUE, (DOF,)),
    (own.student_upper, stats.t.isf, PROBABILITY, (DOF,)),
    *((own.f_tail, stats.f.sf, VALUE, (first, SECOND)) for first in (0.5, 1.0, 3.0, 700.0)),
    *((own.f_upper, stats.f.isf, SMALL, (first, SECOND)) for first in (0.5, 1.0, 3.0, 700.0)),
    (own.normal_tail, stats.norm.sf, VALUE, ()),
    (own.normal_upper, stats.norm.isf, PROBABILITY, ()),
]


@each(FUNCTIONS)
def test_quantiles_and_tails_are_those_of_scipy_stats(row) -> None:
    function, peer, at, dof = row
    np.testing.assert_allclose(function(at, *dof), peer(at, *dof), rtol=1e-12)
    for place in range(len(dof)):  # without degrees of freedom there is no probability
        for none in (0.0, -1.0, np.nan):
            assert np.isnan(function(0.5, *(none if k == place else 3.0 for k in range(len(dof)))))


@each([(1, 10), (24, 1500), (3, 2)])
def test_logarithms_of_tails_are_those_of_scipy_stats(dof: tuple[int, int]) -> None:
    ratio = np.array([0.0, 1e-3, 0.7, 1.0, 3.0, 40.0, 1e5])
    np.testing.assert_allclose(log_f_tail(ratio, *dof), stats.f.logsf(ratio, *dof), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(log_chi2_tail(ratio, dof[0]), stats.chi2.logsf(ratio, dof[0]), rtol=1e-12, atol=1e-12)
    assert log_f_tail(-1e-12, *dof) == 0.0


@each([(1.0, 5.0), (3.0, 60.0), (24.0, 5000.0)])
def test_the_noncentrality_of_f_is_that_with_which_scipy_stats_exceeds_a_value(dof: tuple[float, float]) -> None:
    value = np.array([1.5, 3.0, 12.0])
    away = own.f_noncentrality(0.5, value, *dof)
    np.testing.assert_allclose(stats.ncf.sf(value, *dof, away), 0.5, atol=1e-3)
    assert np.isnan(own.f_noncentrality(0.5, np.nan, *dof))


@pytest.mark.parametrize("size", [8, 20, 60, 500, 50_000])
def test_the_test_of_kurtosis_is_that_of_scipy_stats(size: int) -> None:
    rng = np.random.default_rng(63)
    for values in (rng.standard_normal(size), rng.standard_t(4, size), rng.uniform(2.0, 3.0, size)):
        expected = float(stats.kurtosistest(values, alternative="greater").pvalue)
        assert own.kurtosis_tail(values) == pytest.approx(expected, rel=1e-10, abs=1e-300)


LOADED = """
import sys
from pipelines.cli import main
try:
    main()
except SystemExit as left:
    print(left.code or 0, *sys.modules, file=sys.stderr)
"""


@pytest.mark.parametrize("command", mostly_slow(["noise allan", "noise psd", "diagnose"], "noise psd"))
def test_commands_load_no_library_that_they_do_not_need(command: str, tmp_path: Path) -> None:
    path, idle = tmp_path / "given.csv", {"scipy.stats", "scipy.signal", "matplotlib"}
    if command == "diagnose":
        lot(np.random.default_rng(64), units=2).to_csv(path, index=False)
        options, idle, needed = ["--json"], idle | {"scipy.optimize", "scipy.sparse"}, "scipy.linalg"
    else:
        values = np.random.default_rng(62).normal(0.0, 1e-3, (2000, 3))
        np.savetxt(path, values, fmt="%.7f", delimiter=",", header="x,y,z", comments="")
        options, idle, needed = ["--rate", "100"], idle | {"pandera"}, "numpy"
    call = [sys.executable, "-c", LOADED, *command.split(), str(path), *options]
    status, *loaded = subprocess.run(call, capture_output=True, text=True, check=True).stderr.split()[-3000:]
    assert status in ({"0", "1"} if command == "diagnose" else {"0"})
    assert needed in loaded
    assert not set(loaded) & idle
