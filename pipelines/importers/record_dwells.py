"""The dwells of an import: their numbers, the means of a record's stretches, their reference, and those that are held out."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
import pandas as pd

from inertial import frames
from inertial.arrays import Array, Index
from inertial.counts import number_of
from inertial.estimation.slow_noise import FEWEST_SAMPLES, slow_deviation
from inertial.quantities import ANGLE_COLUMNS, BY_COLUMN, FORCE_COLUMNS
from pipelines.importers.exchange import complete_references
from pipelines.importers.mapping import FACES, OUTPUT_UNITS, TILT, Mapping
from pipelines.importers.stretches import Stretches
from pipelines.importers.values import BOUNDS
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import shown

FEWEST_FITTED = 12
"""Smallest number of dwells of a unit for the fit; the fit of a model with more coefficients states a larger one."""
_SEED = 140
_TURNS_DEG = 1.0
"""Largest turn of a reference angle within a dwell: sin of the mean differs from the mean of sin by 13 µg then."""


def dwell_numbers(labels: Sequence[str], serials: Sequence[str]) -> tuple[Index, tuple[str, ...]]:
    """Numbers of dwells (n,), and a remark where whole numbers of the file are labels only.

    A number names one dwell of a unit, and grows in the order of measurement. Dwells of one number in several units belong
    together in a fit: numbers that run on from one unit to the next count rows.

    Parameters
    ----------
    labels, serials : label and unit of every dwell, in the order of measurement of each unit
    """
    units: Index = pd.factorize(np.asarray(serials, dtype=object))[0].astype(np.int64)
    order: Index = pd.Series(units).groupby(units).cumcount().to_numpy().astype(np.int64)
    stated = np.asarray(pd.to_numeric(pd.Series([*labels]), errors="coerce"), dtype=np.float64)
    if not np.all((stated == np.rint(stated)) & (stated >= BOUNDS["dwell"][0]) & (stated <= BOUNDS["dwell"][1])):
        return order, ()
    numbers = stated.astype(np.int64)
    by_unit = np.argsort(units, kind="stable")
    grows = np.diff(numbers[by_unit])[np.diff(units[by_unit]) == 0] > 0
    alone = units.max(initial=0) > 0 and np.unique(numbers).size == numbers.size > units.max() + 1
    if np.all(grows) and not alone:
        return numbers, ()
    why = "run on from unit to unit" if alone else "repeat or go back within a unit"
    return order, (f"dwells are numbered from 0 in each unit: the numbers of the file {why}, and are labels only",)


def dwells_of_stretches(
    samples: pd.DataFrame, intervals: Stretches, numbers: Index, extras: tuple[str, ...], mapping: Mapping
) -> pd.DataFrame:
    """Dwells in the exchange format; ``numbers``: of the intervals."""
    letters = mapping.letters
    m = len(letters)
    recorded = samples[[*letters, *extras]].to_numpy(dtype=np.float64)
    time, record = samples["time_s"].to_numpy(dtype=np.float64), samples["record"].to_numpy()
    inside = [a + np.flatnonzero(record[a:b] == k) for k, (a, b) in enumerate(intervals.spans, start=1)]
    turning = [name == TILT or (name in BY_COLUMN and BY_COLUMN[name].unit == "°") for name in extras]
    angles = m + np.flatnonzero(turning)
    parts = [_of_one_turn(recorded[rows], angles) for rows in inside]
    _refuse_turning(parts, [m + k for k, name in enumerate(extras) if name in (TILT, *ANGLE_COLUMNS)], numbers)
    mean = np.stack([part.mean(axis=0) for part in parts])
    sd = np.stack([part[:, :m].std(axis=0, ddof=1) if len(part) > 1 else np.zeros(m) for part in parts])
    frame = pd.DataFrame(
        {
            "unit": samples["unit"].iloc[0],
            "dwell": numbers,
            "time_s": [float(time[rows].mean()) for rows in inside],
            **{f"out_{axis}": mean[:, k] for k, axis in enumerate(letters)},
            **{f"sd_{axis}": sd[:, k] for k, axis in enumerate(letters)},
            "n": [rows.size for rows in inside],
            "duration_s": [float(time[rows[-1]] - time[rows[0]]) for rows in inside],
            **{name: mean[:, m + k] for k, name in enumerate(extras)},
            "record": np.arange(len(intervals)) + 1,
            "pose": list(intervals.labels),
        }
    )
    if min(rows.size for rows in inside) >= FEWEST_SAMPLES:
        frame[[f"slow_sd_{axis}" for axis in letters]] = slow_deviation([part[:, :m] for part in parts])
    return finished(frame, mapping)


def _of_one_turn(samples: Array, angles: Index) -> Array:
    """Samples (k, c) whose columns of angles, °, are within half a turn of the first sample: the mean of ±180° is not 0°."""
    apart = samples[:, angles] - samples[0, angles]
    samples[:, angles] -= 360.0 * np.rint(apart / 360.0)
    return samples


def _refuse_turning(parts: Sequence[Array], angles: Sequence[int], numbers: Index) -> None:
    """Refuse a dwell during which a reference angle turns: at a turning point of the output, motion looks like rest."""
    for part, number in zip(parts, numbers.tolist(), strict=True):
        half = max(len(part) // 2, 1)  # of a single sample both halves are the sample itself
        turned_by = 2.0 * np.abs(part[-half:, angles].mean(axis=0) - part[:half, angles].mean(axis=0)).max(initial=0.0)
        if turned_by > _TURNS_DEG:
            raise DataRejected(
                f"import: the reference angle turns by {turned_by:.3g}° within dwell {number}, one position is needed; a "
                "steady turn is read row by row with --set rows=dwells, positions need a shorter --set window_s"
            )


def finished(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The columns that every dwell has, and the reference if poses are stated."""
    frame = frame if "slot" in frame else frame.assign(slot=0)
    frame = frame.assign(kind="dwell", soak=0, out_unit=OUTPUT_UNITS[mapping.units.output][0])
    if TILT in frame.columns:
        return _tilted(frame, mapping)
    if not (mapping.poses or mapping.face):
        complete_references(frame, "import")
        return turned(frame, mapping.norm_g or 1.0)
    if mapping.norm_g is None:
        raise WrongUse(
            "import: poses are stated, local gravity is needed with them; give --set local_gravity_m_s2=M/S2"
        )
    up = [mapping.poses.get(label, mapping.face) for label in frame["pose"]]
    frame[[*FORCE_COLUMNS]] = np.array([FACES[face] for face in up]) * mapping.norm_g
    if mapping.headings:
        frame["heading_deg"] = [mapping.headings[label] for label in frame["pose"]]
    return frame


def turned(frame: pd.DataFrame, gravity: float = 1.0) -> pd.DataFrame:
    """The dwells with the force, g, at the angles of a table, as that of a station, where they have angles and no force."""
    if not set(ANGLE_COLUMNS) <= set(frame.columns) or set(FORCE_COLUMNS) & set(frame.columns):
        return frame
    outer, inner = np.radians(frame[[*ANGLE_COLUMNS]].to_numpy(dtype=np.float64)).T
    return _with_force(frame, frames.force_from_angles(outer, inner), gravity)


def _with_force(frame: pd.DataFrame, force: Array, gravity: float) -> pd.DataFrame:
    """The dwells with a force (n, 3), in units of local gravity, g."""
    return frame.assign(**{name: gravity * force[:, k] for k, name in enumerate(FORCE_COLUMNS)})


def _tilted(frame: pd.DataFrame, mapping: Mapping) -> pd.DataFrame:
    """The force of a single axis turned in one plane: g·sin of its angle above the horizontal along it, g·cos of it across."""
    angle = np.radians(frame[TILT].to_numpy(dtype=np.float64))
    force = frames.without_rounding(np.stack([np.sin(angle), np.cos(angle), 0.0 * angle], axis=-1))
    return _with_force(frame.drop(columns=TILT), force, mapping.norm_g or 1.0)


def _held_out_count(text: str, dwells: int) -> int:
    """The number of dwells to hold out: a number, or a share such as ``20%``."""
    share, number = text.endswith("%"), float("nan")
    with suppress(ValueError):
        number = float(text.removesuffix("%"))
    if not (0.0 < number < (100.0 if share else 1e6)) or (not share and number != int(number)):
        raise WrongUse(
            f"--set verify: found '{shown(text)}', a number of dwells or a share such as 20% is needed; correct it"
        )
    return max(1, round(0.01 * number * dwells)) if share else int(number)


def with_held_out(dwells: pd.DataFrame, text: str, where: str) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """The dwells with kind ``verification`` for those that are held out, and a remark that names them; none for an empty text.

    Of each unit one dwell is drawn from each of so many stretches of equal length; the first and the last dwell stay in the fit,
    so that it does not extrapolate in time. The draw depends on the number of dwells only.

    Raises
    ------
    DataRejected
        Too few dwells are left for the fit.
    WrongUse
        The text is neither a number nor a share.
    """
    if not text:
        return dwells, ()
    kinds = dwells["kind"].astype(object).to_numpy().copy()
    named: list[str] = []
    for unit, places in dwells.groupby("unit", sort=False).indices.items():
        count = _held_out_count(text, len(places))
        if len(places) - count < FEWEST_FITTED:
            raise DataRejected(
                f"{where}: {number_of(len(places), 'dwell')} of unit {unit}, verify={shown(text)} leaves "
                f"{max(len(places) - count, 0)} of them, {FEWEST_FITTED} are needed for the fit at least; hold out fewer, or "
                "measure more positions"
            )
        chosen = places[_drawn(len(places), count)]
        kinds[chosen] = "verification"
        named.append(f"{unit}: {', '.join(str(number) for number in dwells['dwell'].to_numpy()[chosen])}")
    return dwells.assign(kind=kinds), (f"held out for verification: {'; '.join(named)}",)


def _drawn(dwells: int, count: int) -> np.ndarray:
    """Indices of ``count`` of ``dwells``: one in each of as many equal stretches, neither the first nor the last dwell."""
    rng = np.random.default_rng(_SEED + 1000 * dwells + count)
    edges = np.linspace(1, dwells - 1, count + 1)
    first = np.ceil(edges[:-1]).astype(np.int64)
    last = np.maximum(np.ceil(edges[1:]).astype(np.int64), first + 1)
    return rng.integers(first, last)
