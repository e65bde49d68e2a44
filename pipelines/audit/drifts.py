"""Drift since the last calibration: per kind of device and parameter, per unit, and the date when a unit leaves its tolerance."""

from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Flags
from inertial.population.drift import (
    DeviceDrift,
    LatestState,
    drifts_known,
    forecast,
    in_tolerance,
    kind_of,
    last_reliable,
    prudent,
    seating_of,
)
from pipelines.audit.calibrations import Calibrations
from pipelines.audit.pairs import YEAR_D, Pairs, changes_of, e_n_of, pairs_of, spans_of
from pipelines.audit.parameters import FAMILIES, FAMILY_OF, NAMES
from pipelines.audit.rules import Rules

MONTH_D = YEAR_D / 12.0
OF_UNIT = tuple(name for name in NAMES if FAMILIES[FAMILY_OF[name]].of_unit)
FEWEST_PAIRS = 8
AHEAD = np.arange(0.0, 10.0 + 1e-9, 1.0 / 24.0)  # years, in steps of half a month


@dataclass(frozen=True)
class KindDrift:
    """Drift of one parameter of one kind of device, and the last changes relative to the uncertainty of both values.

    ahead : the drift for forecasts, see :func:`~inertial.population.drift.prudent`
    beyond : share of the pairs with |E_n| > 1; out : share with a change above the tolerance; median : of |change|
    reliable_months : time in which a unit of the kind stays in all tolerances with the target's probability; NaN without one
    seating : standard deviation of one mounting as E_n allows for it, and its degrees of freedom
    known : whether any pair is long enough apart to identify a drift; without one there is no forecast
    """

    device: str
    parameter: str
    kind: DeviceDrift
    ahead: DeviceDrift
    beyond: float
    out: float
    median: float
    tolerance: float
    reliable_months: float
    known: bool = True
    seating: tuple[float, float] = (0.0, 1.0)


def kind_drifts(calibrations: Calibrations, good: Flags, rules: Rules, since: float) -> list[KindDrift]:
    """Drift of every parameter of every kind, from all pairs; the shares are of the pairs that end in the period."""
    pairs, out = pairs_of(calibrations, good), list[KindDrift]()
    spans = spans_of(calibrations, pairs)
    for device in np.unique(calibrations.device.astype(str)):
        drifts = (_kind_drift(calibrations, pairs, spans, device, name, rules, since) for name in OF_UNIT)
        found = [drift for drift in drifts if drift is not None]
        months = float("nan")
        if all(drift.known for drift in found):
            months = _reliable_months(calibrations, pairs, found, rules.reliability_target)
        out += [replace(drift, reliable_months=months if np.isfinite(drift.tolerance) else np.nan) for drift in found]
    return out


def _reliable_months(calibrations: Calibrations, pairs: Pairs, kinds: list[KindDrift], target: float) -> float:
    """Time in which a new unit stays in all tolerances of its kind with the target's probability, months."""
    probability = np.ones((1, AHEAD.size))
    for kind in kinds:
        if np.isfinite(kind.tolerance):
            of_kind = calibrations.device[pairs.later] == kind.device
            sigma = float(np.nanmedian(calibrations.error(kind.parameter)[pairs.later[of_kind]]))
            start, fresh = np.array([0.0]), np.array([sigma**2 + kind.ahead.mount_sd**2])
            slope, spread = np.array([kind.ahead.mean_slope]), np.array([kind.ahead.slope_sd**2])
            new = LatestState(start, slope, fresh, start, spread, start, start)
            probability *= in_tolerance(*forecast(new, kind.ahead, AHEAD, origin=0.0), kind.tolerance)
    return 12.0 * float(last_reliable(probability, target, AHEAD)[0])


def _kind_drift(
    calibrations: Calibrations, pairs: Pairs, spans: Pairs, device: str, name: str, rules: Rules, since: float
) -> KindDrift | None:
    """Drift of one parameter of a kind; None with too few pairs."""
    change, known = changes_of(calibrations, pairs, name)
    longer, longer_known = changes_of(calibrations, spans, name)
    chosen = (calibrations.device[pairs.later] == device) & np.isfinite(change + known)
    long = (calibrations.device[spans.later] == device) & np.isfinite(longer + longer_known)
    if chosen.sum() < FEWEST_PAIRS:
        return None
    both = ((change, longer), (pairs.years, spans.years), (known, longer_known))
    together = tuple(np.concatenate([near[chosen], far[long]]) for near, far in both)
    kind, tolerance = kind_of(*together), rules.tolerance_of(device, FAMILY_OF[name])
    seating = seating_of(kind, *together, pairs=int(chosen.sum()))
    recent = chosen & (calibrations.day[pairs.later] >= since)
    numbers, moved = e_n_of(calibrations, pairs, name, seating)[recent], np.abs(change[recent])
    numbers = numbers[np.isfinite(numbers)]
    return KindDrift(
        device=device,
        parameter=name,
        kind=kind,
        ahead=prudent(kind, *together),
        beyond=float(np.mean(np.abs(numbers) > 1.0)) if numbers.size else 0.0,
        out=float(np.mean(moved > tolerance)) if moved.size else 0.0,
        median=float(np.median(moved)) if moved.size else 0.0,
        tolerance=tolerance,
        reliable_months=float("nan"),
        known=drifts_known(together[1]),
        seating=seating,
    )
