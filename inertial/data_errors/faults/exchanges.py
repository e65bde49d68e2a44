"""Readings with a wrong assignment: of another unit, another range, another pose."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inertial.data_errors.exchanged import PlainFit
from inertial.data_errors.faults.fault import Fault, look, places_of
from inertial.data_errors.readings import Array, Readings, exchanged, find_split

_COMMON = 5.0
"""Multiple of the usual misfit that half of the units exceed in a dwell whose pose is wrong for all."""

_AWAY = 0.005
"""Distance, g, from its own calibration above which the output of a unit may be that of another."""


@look(50)
def changed_units(readings: Readings) -> Iterator[Fault]:
    """A calibration that changes during the run: to that of another unit (cables exchanged), or to another range."""
    splits = {
        u: s for u in range(len(readings.force)) if (s := find_split(readings.force[u], readings.output[u])) is not None
    }
    for unit, split in splits.items():
        places = tuple(range(split.place, _length(readings, unit)))
        partner = next((v for v, other in splits.items() if v != unit and exchanged(split, other)), None)
        if partner is not None:
            yield Fault(
                "units_swapped",
                unit,
                places,
                f"from dwell {split.place} on it has the calibration of unit {partner}",
            )
        elif not 0.75 < split.ratio < 1.33:
            yield Fault(
                "wrong_range", unit, places, f"scale changes by a factor {split.ratio:.3g} at dwell {split.place}"
            )


def _length(readings: Readings, unit: int) -> int:
    """Number of dwells up to the last one a unit has."""
    return int(np.flatnonzero(readings.there[unit])[-1]) + 1


@look(90)
def swapped_units(readings: Readings) -> Iterator[Fault]:
    """Dwells that two units' fingerprints say were exchanged between them."""
    units, n = readings.there.shape
    if units < 2:
        return
    exchanged: dict[tuple[int, int], list[int]] = {}
    # who is at home in its own calibration was not exchanged
    away = np.any(np.linalg.norm(readings.misfit, axis=-1) > _AWAY, axis=0)
    for place in np.flatnonzero(away).tolist():
        for pair in _exchanges(readings, place):
            exchanged.setdefault(pair, []).append(place)
    for (one, other), places in exchanged.items():
        if len(places) >= max(3, n // 20):
            for unit, partner in ((one, other), (other, one)):
                evidence = f"{len(places)} dwells have the bias and scale of unit {partner}"
                yield Fault("units_swapped", unit, tuple(places), evidence)


def _exchanges(readings: Readings, place: int) -> Iterator[tuple[int, int]]:
    """Pairs of units whose outputs at one dwell fit each other's calibration far better than their own."""
    there = np.flatnonzero(readings.there[:, place])
    design = np.concatenate([np.ones((there.size, 1)), readings.force[there, place]], axis=-1)
    predicted = np.einsum("vip,up->uvi", readings.fits[there], design)
    scale = readings.scale[there]
    distance = np.linalg.norm((readings.output[there, place][:, None] - predicted) / scale[:, None, None], axis=-1)
    own = np.diag(distance)
    best = np.argmin(distance, axis=1)
    for i, j in enumerate(best):
        mutual = j > i and best[j] == i
        if mutual and distance[i, j] < 0.2 * own[i] and distance[j, i] < 0.2 * own[j] and own[i] > _AWAY:
            yield int(there[i]), int(there[j])


@look(100)
def wrong_poses(readings: Readings) -> Iterator[Fault]:
    """Dwells whose output belongs to another direction of gravity than the one commanded."""
    size = np.linalg.norm(readings.misfit, axis=-1)
    typical = np.nanmedian(size, axis=1, keepdims=True)
    out = size > np.maximum(0.02, 15.0 * typical)
    if len(out) > 2:
        # an error of most units belongs to the plan or the table: the search for effects reports it
        ratio = np.nanmedian(size / np.where(typical > 0.0, typical, np.inf), axis=0, keepdims=True)
        out &= ratio < _COMMON
    # of two units that were exchanged the search for effects reports it, too
    swapped = set(_exchanged_from_a_dwell_on(readings)) if out.any() else set[int]()
    for unit, row in enumerate(out):
        places = np.flatnonzero(row)
        if not places.size or places.size > 0.4 * row.size or unit in swapped:
            continue
        felt = _felt(readings, unit, places)
        turned = np.abs(np.linalg.norm(felt, axis=-1) - 1.0) < 0.02
        if not turned.any():
            continue
        name, text = _which_pose(readings.force[unit], places[turned], felt[turned])
        yield Fault(name, unit, places_of(places[turned]), text)


def _exchanged_from_a_dwell_on(readings: Readings) -> Iterator[int]:
    """Units that have the readings of another one from a dwell on."""
    warm = readings.temperature if readings.temperature is not None else readings.chamber
    theta = None if warm is None or not np.isfinite(warm[readings.there]).all() else warm
    output = readings.output
    fit = PlainFit(output, readings.force, theta, readings.there, lambda one, other: output[[other, one]])
    for pair in fit.pairs():
        if fit.instants(*pair):
            yield from pair


def _felt(readings: Readings, unit: int, places: NDArray[np.intp]) -> Array:
    """Specific force that the outputs at some dwells stand for, (k, 3), g."""
    fit = readings.fits[unit]
    return np.linalg.solve(fit[:, 1:], (readings.output[unit, places] - fit[:, 0]).T).T


def _which_pose(force: Array, places: NDArray[np.intp], felt: Array) -> tuple[str, str]:
    for i, a in enumerate(places):
        for j in range(i + 1, len(places)):
            b = places[j]
            if np.linalg.norm(felt[i] - force[b]) < 0.05 and np.linalg.norm(felt[j] - force[a]) < 0.05:
                return "swapped_dwells", f"dwells {a} and {b} have exchanged poses"
    angle = np.degrees(np.arccos(np.clip(np.sum(felt[0] * force[places[0]]), -1.0, 1.0)))
    return "wrong_pose", f"dwell {places[0]} was measured {angle:.1f}° from the commanded pose"
