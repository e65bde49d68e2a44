"""Exported C headers compiled with the C compiler of this machine, and run."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAIN = """
#include <stdio.h>
#include <stdlib.h>
#include "calibration.h"
int main(int argc, char **argv)
{
    (void)argc;
    tumbleline_calibration spoilt = tumbleline_UNIT;
    spoilt.bias[1][2] = spoilt.bias[1][2] + 1;
    if (tumbleline_crc32(0, (const unsigned char *)"123456789", 9) != 0xCBF43926u) return 2;
    if (!tumbleline_intact(&tumbleline_UNIT) || tumbleline_intact(&spoilt)) return 3;
    double x, y, z, t;
    FILE *in = fopen(argv[1], "r");
    while (fscanf(in, "%lf %lf %lf %lf", &x, &y, &z, &t) == 4) {
        CALL
    }
    return 0;
}
"""
REAL = """
        const REAL output[3] = {(REAL)x, (REAL)y, (REAL)z};
        REAL force[3];
        if (tumbleline_correct(&tumbleline_UNIT, output, (REAL)t, force)) return 1;
        printf("%.17g %.17g %.17g\\n", (double)force[0], (double)force[1], (double)force[2]);
"""
FIXED = """
        const tumbleline_calibration *c = &tumbleline_UNIT;
        const int32_t output[3] = {tumbleline_from_counts(c, (int32_t)x), tumbleline_from_counts(c, (int32_t)y),
                                   tumbleline_from_counts(c, (int32_t)z)};
        int32_t force[3];
        int32_t mC = (int32_t)(1000.0 * t + (t < 0 ? -0.5 : 0.5));
        if (tumbleline_correct(c, output, mC, force) != (mC < c->low_mC || mC > c->high_mC)) return 4;
        printf("%.17g %.17g %.17g\\n", force[0] / 16777216.0, force[1] / 16777216.0, force[2] / 16777216.0);
"""


def compiled(header: str, call: str, rows: Array, folder: Path, unit: str = "SN_1") -> Array:
    """What the compiled header computes for rows of x, y, z, temperature."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler here")
    (folder / "calibration.h").write_text(header, encoding="utf-8")
    (folder / "main.c").write_text(MAIN.replace("CALL", call).replace("UNIT", unit), encoding="utf-8")
    np.savetxt(folder / "rows.txt", rows, fmt="%.17g")
    command = [compiler, "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "main.c", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    done = subprocess.run([folder / "main", "rows.txt"], cwd=folder, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.returncode
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
