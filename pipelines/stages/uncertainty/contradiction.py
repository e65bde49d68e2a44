"""What a lot shows of its references: the common residual of its units against the stated errors of the table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial import design
from inertial.arrays import Array, Places
from inertial.correction import predict
from inertial.fits.wander import wander_kernels
from inertial.uncertainty.contradiction import (
    CommonEvidence,
    Size,
    beyond,
    common_evidence,
    contradictions,
    probability,
    sizes,
    without,
)
from inertial.uncertainty.influences import Errors, MeasurementModel, difference, sensitivity
from pipelines.stages.noisy_fit import fitted_with_noise
from pipelines.stages.uncertainty.budget import conditions, with_device_temperature
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.contributions import influences
from pipelines.tables.dwells import LotArrays
from schemas.uncertainty import Uncertainty

JUDGED = ("level", "orthogonality", "outer_offset", "inner_offset", "harmonics", "pose")
"""Contributions of the table that all units of a lot share."""
COMMON = ("station", "run", "soak", "pose", "dwell")
"""Scopes of what all units of a lot share."""
FEWEST = 2
DWELL = "dwell"
ALONG_G = 1e-5  # size of the errors along the force that are looked for; the probability does not depend on it


@dataclass(frozen=True)
class LotReferences:
    """The judgement of a lot.

    found : contributions larger than stated; looked : every contribution that is seen, as far as it is
    p_value : over all contributions; along_p : of the common residual along the force, which no angle makes
    """

    found: tuple[Size, ...]
    looked: tuple[Size, ...]
    p_value: float
    along_p: float


def lot_references(tables: BudgetTables, terms: BudgetTerms) -> LotReferences | str:
    """The judgement of a lot with known angles and a statement of the table; a text says why there is none."""
    lot = tables.arrays()
    if terms.stated is None or lot.state.outer is None:
        return "no angles of a table are recorded" if terms.stated else "no uncertainty of references is stated"
    if len(lot.units) < FEWEST:
        return "one unit alone: errors of the table cannot be separated from its noise; measure two or more together"
    evidence, groups, along = _evidence(lot, tables, terms, terms.stated)
    first = int(along[0])  # the influences along the force are the last, and taken to be zero
    of_table = CommonEvidence(evidence.information[:first, :first], evidence.projection[:first])
    looked = sizes(of_table, groups)
    found = contradictions(of_table, groups, looked)
    return LotReferences(tuple(found), tuple(looked), probability(looked), beyond(evidence, along, groups, found))


def _evidence(
    lot: LotArrays, tables: BudgetTables, terms: BudgetTerms, stated: Uncertainty
) -> tuple[CommonEvidence, dict[str, Places], Places]:
    """The evidence on the common influences, and the indices of the judged influences and of those along the force (the last)."""
    calibration, state = tables.calibrated(), lot.state
    model = MeasurementModel(calibration.effects, calibration.coefficients, calibration.nonlinear)
    physical = with_device_temperature(model, calibration.response, terms.stability, calibration.axes)
    if stated.pose is not None:  # their repeatability also where the budget leaves it to the scatter of the fit
        stated = stated.model_copy(update={"pose": stated.pose.model_copy(update={"seen_in_residuals": False})})
    inputs, scattered = influences(stated, conditions(lot, tables.dwells, calibration.response, terms), terms.stability)
    common = [error for error in inputs if error.scope in COMMON]
    source = sensitivity(physical, state, common, scattered)
    shape = (*lot.output.shape, -1)
    along = _each_dwell(ALONG_G * difference(physical, state, Errors(gravity=1.0)), lot.output.shape)
    sensor, station = design.split(model.effects)
    columns = design.local_columns(sensor, state, model.nonlinear)
    columns = np.broadcast_to(columns, (len(lot.units), *columns.shape[-3:]))
    left = lot.output - predict(model.effects, state, model.coefficients, model.nonlinear)
    parts = [np.broadcast_to(source.changes, (*lot.output.shape, source.changes.shape[-1])), along]
    if station:
        shared = design.shared_columns(station, state, model.nonlinear, calibration.response)
        parts.insert(
            0, np.moveaxis(np.broadcast_to(shared, (len(lot.units), *shared.shape[-3:])), -3, -2).reshape(shape)
        )
    free = parts[0].shape[-1] if station else 0
    evidence = common_evidence(columns, np.concatenate(parts, axis=-1), left, _noise(lot, left, model.effects))
    names = np.array(source.contributions, dtype=object)
    groups = {name: np.flatnonzero(names == name) for name in JUDGED if np.any(names == name)}
    return without(evidence, np.arange(free)), groups, names.size + np.arange(along.shape[-1])


def _each_dwell(change: Array, shape: tuple[int, ...]) -> Array:
    """A change (units, n, 3) as n changes of a single dwell each, (units, n, 3, n)."""
    change = np.broadcast_to(change, shape)
    out = np.zeros((*shape, shape[1]))
    every = np.arange(shape[1])
    out[:, every, :, every] = np.moveaxis(change, 1, 0)
    return out


def _noise(lot: LotArrays, left: Array, effects: Sequence[str]) -> Array:
    """Covariance (units, 3, n, n) of the noise that units do not share.

    The fit's own noise contains the errors of the table. So it is estimated again, of the units' differences from their mean
    residual, whose variance is less by one unit in all; from the poses of verification, too, of which a short recipe has most.
    """
    units = len(lot.units)
    scale = np.sqrt(np.mean(lot.standard_error**2, axis=1))
    common = np.mean(left, axis=0)
    fitted = fitted_with_noise(replace(lot, output=lot.output - common, kinds=np.full_like(lot.kinds, DWELL)), effects)
    time = np.broadcast_to(lot.state.time, lot.output.shape[:2])[0]
    flicker, walk = wander_kernels(time)
    profile = np.moveaxis(lot.standard_error / scale[:, None, :], 1, -1) * fitted.white[..., None]
    total = profile[..., None] ** 2 * np.eye(time.size)
    total = total + fitted.flicker[..., None, None] ** 2 * flicker + fitted.walk[..., None, None] ** 2 * walk
    return total * units / (units - 1.0)
