"""An archive of earlier calibrations with a known family, without measurements: coefficients, covariances and what made them."""

from pathlib import Path
from typing import Any

import numpy as np

from inertial.fits.linear import LotFit
from pipelines.archive import Archive
from pipelines.jobs.recipes import load_recipe
from pipelines.tables.calibration import coefficient_rows, column_names, covariance_rows

LSB = 256000.0
LOTS, UNITS = 12, 4


def wafer_of(lot: int, k: int) -> str:
    """The wafer of a unit: the dice of one go into several lots."""
    return f"W{(lot + k) % LOTS:02d}"


def family_archive(
    root: Path, recipe: str, spread: float, *, lots: int = LOTS, wafers: float = 0.0, **changes: Any
) -> Archive:
    """Lots of simulated units whose coefficients spread by so much, g, about a bias of zero and the nominal scale.

    wafers : spread between wafers, g; changes : of the archived recipe
    """
    archive, own = Archive(root), load_recipe(recipe).model_copy(update=changes)
    archive.prepare()
    names = column_names(own.effects)
    middle = LSB * np.array([[effect == "scale" for effect, _ in axis] for axis in names], dtype=float)
    for lot in range(lots):
        rng = np.random.default_rng([7, lot])
        values = middle + LSB * spread * rng.standard_normal((UNITS, *middle.shape))
        for k in range(UNITS):
            own_wafer = np.random.default_rng([8, int(wafer_of(lot, k)[1:])])
            values[k] += LSB * wafers * own_wafer.standard_normal(middle.shape)
        error = np.broadcast_to((LSB * 1e-6) ** 2 * np.eye(middle.shape[1]), (*values.shape, middle.shape[1]))
        fit = LotFit(
            tuple(own.effects), values, error, names, np.zeros(0), np.zeros((0, 0)), (), {}, values, values, values
        )
        units = [f"E{lot:02d}-{k}" for k in range(UNITS)]
        about = {
            "recipe": own.model_dump(mode="json"), "station": {"kind": "simulated", "name": "test"}, "capture": f"c{lot}",
            "lot": {"device": own.device, "units": [{"serial": unit, "slot": k} for k, unit in enumerate(units)]},
        }  # fmt: skip
        run = archive.open_run(own.name, about, [lot, str(changes)])
        tables = {
            "coefficients": coefficient_rows(units, fit, error, "LSB", {}),
            "covariance": covariance_rows(units, error),
        }
        run.save("fit", f"{lot}", tables, {"inputs": {}, "parameters": {}, "code": ""})
    return archive
