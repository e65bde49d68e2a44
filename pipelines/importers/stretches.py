"""The static stretches of a record: by labels, by blocks, by positions logged back to back, or detected in the record itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from inertial import change_of_level, static_intervals
from pipelines.importers.mapping import Mapping
from schemas.errors import DataRejected, did_you_mean

_MOST_LISTED = 6


@dataclass(frozen=True)
class Stretches:
    """Static stretches: first and one past the last sample, and label of each; remarks on how they were found."""

    first: tuple[int, ...]
    last: tuple[int, ...]
    labels: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Their number."""
        return len(self.first)

    def only(self, numbers: Sequence[int]) -> Stretches:
        """Some of them, by their numbers from 0."""
        first, last = (tuple(rows[k] for k in numbers) for rows in (self.first, self.last))
        return Stretches(first, last, tuple(self.labels[k] for k in numbers), self.remarks)


def stretches(
    labels: Sequence[str] | None,
    output: NDArray[np.float64],
    time: NDArray[np.float64],
    breaks: Sequence[int],
    mapping: Mapping,
    where: str,
) -> Stretches:
    """The static stretches of a record that the mapping keeps.

    Parameters
    ----------
    labels : of every sample, if a column has them.
    output, time : (n, 3) and (n,), s.
    breaks : samples before which rows or time are missing: no stretch crosses one.

    Raises
    ------
    DataRejected
        A stretch holds several positions, or a label of a pose does not exist.
    """
    edges = [0, *(k for k in breaks if 0 < k < len(time)), len(time)]
    if labels is not None:
        intervals = _by_labels(labels, edges)
    elif mapping.positions is not None:
        intervals = _by_positions(output, mapping.positions, where)
    elif mapping.block_s is not None:
        intervals = _by_blocks(time, edges, mapping.block_s)
    else:
        intervals = _static_stretches(output, time, edges, mapping)
        _refuse_several_positions(intervals, output, where)
    return _named(intervals, mapping, where)


def _by_labels(labels: Sequence[str], edges: list[int]) -> Stretches:
    names = np.asarray(labels, dtype=object)
    first = sorted({*(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), *edges[:-1]})
    last = [*first[1:], names.size]
    return Stretches(tuple(first), tuple(last), tuple(str(names[k]) for k in first))


def _by_blocks(time: NDArray[np.float64], edges: list[int], block_s: float) -> Stretches:
    number = np.floor((time - time[0]) / block_s).astype(np.int64)
    first = sorted({*(np.flatnonzero(np.diff(number)) + 1).tolist(), *edges[:-1]})
    last = [*first[1:], time.size]
    return Stretches(tuple(first), tuple(last), tuple(f"block {k}" for k in range(len(first))))


def _by_positions(output: NDArray[np.float64], count: int, where: str) -> Stretches:
    try:
        levels = change_of_level.levels(output, count)
    except ValueError as problem:
        raise DataRejected(f"{where}: {problem}") from None
    # the samples beside a change may belong to either side
    start, stop = levels.start + (levels.start > 0), levels.stop - (levels.stop < len(output))
    remark = f"{len(levels)} positions logged back to back, {100.0 * levels.explained:.4g} % of the scatter explained by them"
    names = tuple(f"position {k}" for k in range(len(levels)))
    return Stretches(tuple(start.tolist()), tuple(stop.tolist()), names, (remark,))


def _static_stretches(
    output: NDArray[np.float64], time: NDArray[np.float64], edges: list[int], mapping: Mapping
) -> Stretches:
    window, shortest = mapping.window_s or 1.0, mapping.shortest_s or 1.0
    first: list[int] = []
    last: list[int] = []
    for a, b in pairwise(edges):
        if b - a < 3 or time[b - 1] <= time[a]:
            continue
        rate = mapping.rate_hz or (b - a - 1) / float(time[b - 1] - time[a])
        if b - a < 3 * max(3, round(window * rate)):
            continue
        piece = static_intervals.find(
            output[a:b], rate, window_s=window, shortest_s=shortest, threshold=mapping.threshold
        )
        first += (piece.start + a).tolist()
        last += (piece.stop + a).tolist()
    return Stretches(tuple(first), tuple(last), tuple(f"dwell {k}" for k in range(len(first))))


def _refuse_several_positions(intervals: Stretches, output: NDArray[np.float64], where: str) -> None:
    """Refuse stretches with more scatter than noise: positions logged one after another."""
    counts = [change_of_level.several_levels(output[a:b]) for a, b in zip(intervals.first, intervals.last, strict=True)]
    several = [k for k, count in enumerate(counts) if count > 1]
    if not several:
        return
    worst = max(several, key=lambda k: counts[k])
    a, b = intervals.first[worst], intervals.last[worst]
    total = change_of_level.several_levels(output)
    offer = (
        f"--positions {total} divides the record at the changes"
        if total > 1
        else "--window 0.2 --shortest 0.2 finds shorter dwells"
    )
    raise DataRejected(
        f"{where}: rows {a + 1} to {b}: one dwell by its scatter, but about {counts[worst]} positions logged back to back by its "
        f"levels; a position per dwell is needed; {offer}, or map a column of labels as dwell=…"
    )


def _named(intervals: Stretches, mapping: Mapping, where: str) -> Stretches:
    """The stretches with a label of a pose; all without poses."""
    if not mapping.poses:
        return intervals
    missing = [label for label in mapping.poses if label not in intervals.labels]
    if missing:
        raise DataRejected(
            f"{where}: no dwell is labelled '{missing[0]}' (in --poses); {did_you_mean(missing[0], intervals.labels)}"
        )
    return intervals.only([k for k, label in enumerate(intervals.labels) if label in mapping.poses])
