"""Exchanged serials: calibrations that do not fit the history of their unit, and the unit whose history they fit."""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Flags, Index
from inertial.population.fingerprints import ChangeScale, alike_below, change_scale, distance, foreign_above, nearest
from pipelines.audit.calibrations import Calibrations
from pipelines.audit.pairs import YEAR_D
from pipelines.audit.parameters import FAMILY_OF, NAMES
from pipelines.audit.rules import Rules

FEWEST_PAIRS = 20  # with fewer calibrations of a kind its usual change is unknown
TURNS = [k for k, name in enumerate(NAMES) if FAMILY_OF[name] == "rotation"]
ROUNDS = 4


@dataclass(frozen=True)
class Stranger:
    """A calibration that does not belong to the unit of its serial.

    row : its index among the calibrations; distance : to the unit's previous calibration, in usual changes (rms)
    looks_like : serial whose history it fits, empty without one
    exchanged : whether that serial's calibration of the same day fits the history of this unit
    """

    row: int
    distance: float
    looks_like: str
    exchanged: bool


def strangers(calibrations: Calibrations, rules: Rules | None = None) -> list[Stranger]:
    """The calibrations that do not belong to their unit, in order; each kind of device separately.

    Such a calibration is not part of the history: the next calibration is compared with the one before it.

    Parameters
    ----------
    rules : their tolerances apply to a kind with too few calibrations for its usual change
    """
    out: list[Stranger] = []
    for device in np.unique(calibrations.device.astype(str)):
        rows = np.flatnonzero(calibrations.device == device)
        values = _fingerprints(calibrations, rows)
        before = _before(calibrations.histories[rows], np.ones(rows.size, dtype=bool))
        pairs = np.flatnonzero(before >= 0)
        if pairs.size < FEWEST_PAIRS:
            exchanged = exchanged_pairs(calibrations, rows, before, rules) if rules is not None else []
            out += [
                Stranger(int(rows[k]), far, str(calibrations.unit[rows[other]]), exchanged=True)
                for k, other, far in exchanged
            ]
            continue
        years = (calibrations.day[rows] - calibrations.day[rows][before]) / YEAR_D
        scale = change_scale(values[pairs], values[before[pairs]], years[pairs], values[before < 0])
        if scale.count == 0:
            continue
        foreign = _foreign(values, calibrations.histories[rows], calibrations.day[rows], scale)
        out += _described(calibrations, rows, values, foreign, scale)
    return sorted(out, key=lambda stranger: stranger.row)


def _fingerprints(calibrations: Calibrations, rows: Index) -> Array:
    """Parameters that belong to the unit and that all calibrations of the kind have, (n, p); the others are set to zero."""
    values = calibrations.values[rows].copy()
    values[:, TURNS] = 0.0
    values[:, ~np.isfinite(values).all(axis=0)] = 0.0
    return values


def _before(histories: Index, good: Flags) -> Index:
    """For every calibration the last good one before it of the same unit; −1 where there is none."""
    last, out, unit = -1, np.full(histories.size, -1), -1
    for k in range(histories.size):
        if histories[k] != unit:
            unit, last = histories[k], -1
        out[k] = last
        if good[k]:
            last = k
    return out


def _foreign(values: Array, histories: Index, days: Array, scale: ChangeScale) -> Flags:
    """Mask (m,) of the calibrations that do not fit the last fitting calibration before them."""
    foreign = np.zeros(len(values), dtype=bool)
    for _ in range(ROUNDS):
        before = _before(histories, ~foreign)
        far = np.zeros_like(foreign)
        pairs = np.flatnonzero(before >= 0)
        years = (days[pairs] - days[before[pairs]]) / YEAR_D
        far[pairs] = distance(values[pairs], values[before[pairs]], scale, years) > foreign_above(scale)
        if np.array_equal(far, foreign):
            break
        # of two neighbours that are both far the earlier one is tested first: the later one may fit without it
        first = far & ~np.concatenate([[False], far[:-1] & (histories[1:] == histories[:-1])])
        foreign = np.where(foreign.any(), far, first)
    return foreign


def _described(
    calibrations: Calibrations, rows: Index, values: Array, foreign: Flags, scale: ChangeScale
) -> list[Stranger]:
    before = _before(calibrations.histories[rows], ~foreign)
    histories, days = calibrations.histories[rows], calibrations.day[rows]
    out: list[Stranger] = []
    for k in map(int, np.flatnonzero(foreign)):
        other, unit = _fits(k, values, foreign, histories, days, scale)
        exchanged = _exchanged(k, unit, values, foreign, histories, days, before, scale) if other >= 0 else False
        years = float(days[k] - days[before[k]]) / YEAR_D
        usual = float(np.sqrt(distance(values[k], values[before[k]], scale, years) / scale.count))
        out.append(Stranger(int(rows[k]), usual, str(calibrations.unit[rows[other]]) if other >= 0 else "", exchanged))
    return out


def _fits(k: int, values: Array, foreign: Flags, histories: Index, days: Array, scale: ChangeScale) -> tuple[int, int]:
    """Nearest earlier good calibration and its unit, where ``k`` fits the history of that unit alone; else (−1, −1)."""
    candidates = np.flatnonzero((days < days[k]) & ~foreign & (histories != histories[k]))
    if not candidates.size:
        return -1, -1
    years = (days[k] - days[candidates]) / YEAR_D
    best, least = nearest(values[k], values[candidates], scale, years)
    index, unit = int(candidates[best]), int(histories[candidates[best]])
    fitting = histories[candidates[distance(values[k], values[candidates], scale, years) <= foreign_above(scale)]]
    return (index, unit) if least <= alike_below(scale) and np.all(fitting == unit) else (-1, -1)


def _exchanged(
    k: int, unit: int, values: Array, foreign: Flags, histories: Index, days: Array, before: Index, scale: ChangeScale
) -> bool:
    """Whether the other unit has a foreign calibration of the same days that fits the history of this unit."""
    near = np.flatnonzero(foreign & (histories == unit) & (np.abs(days - days[k]) <= 1.0))
    years = np.abs(days[near] - days[before[k]]) / YEAR_D
    return bool(np.any(distance(values[near], values[before[k]], scale, years) <= foreign_above(scale)))


COVERAGE = 2.0


def exchanged_pairs(
    calibrations: Calibrations, rows: Index, before: Index, rules: Rules
) -> list[tuple[int, int, float]]:
    """Pairs of calibrations of one run that fit each other's history and not their own; both directions, with the distance.

    A calibration fits a history where every parameter with a tolerance stays in it, or outside by at most the uncertainty of
    both. The distance is to its own history, in tolerances (rms).

    Parameters
    ----------
    rows : (m,), calibrations of one kind of device
    before : (m,), index among them of the unit's previous calibration; −1 without one
    """
    device = str(calibrations.device[rows[0]]) if rows.size else ""
    bound = np.array([rules.tolerance_of(device, FAMILY_OF[name]) for name in NAMES])
    pairs, past = list[tuple[int, int, float]](), [int(rows[index]) for index in before]
    for run in np.unique(calibrations.run[rows[before >= 0]].astype(str)):
        candidates = np.flatnonzero((calibrations.run[rows] == run) & (before >= 0))
        far = [int(k) for k in candidates if not _within(calibrations, rows[k], past[k], bound)]
        apart = {k: (calibrations.values[rows[k]] - calibrations.values[past[k]]) / bound for k in far}
        pairs += [
            (k, other, float(np.sqrt(np.nanmean(apart[k][np.isfinite(bound)] ** 2))))
            for k in far
            for other in far
            if k != other
            and _within(calibrations, rows[k], past[other], bound)
            and _within(calibrations, rows[other], past[k], bound)
        ]
    return pairs


def _within(calibrations: Calibrations, row: int, past: int, bound: Array) -> bool:
    change = np.abs(calibrations.values[row] - calibrations.values[past])
    expanded = COVERAGE * np.hypot(calibrations.errors[row], calibrations.errors[past])
    # parameters outside the model are NaN and are ignored; without any parameter nothing fits
    known = np.isfinite(change) & np.isfinite(bound)
    return bool(known.any() and np.all(change[known] <= (bound + expanded)[known]))
