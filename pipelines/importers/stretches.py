"""The static stretches of a record: by labels, by blocks, by positions logged back to back, or detected in the record itself."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from inertial import change_of_level, static_intervals
from inertial.arrays import Array
from pipelines.importers.mapping import Mapping
from pipelines.importers.unit_check import GRAVITY
from schemas.errors import DataRejected, did_you_mean
from schemas.units import AXES

WINDOWS_S = (1.0, 0.5, 0.25)
"""Windows of the search for stops, s: a hand rests for a second or more, in a hurry for less."""
STRICT = (3.0, 2.0)
"""Scatter that means motion, in that of the quietest stretch, where the limit found in the record takes two stops for one."""
_SHIFTED = 0.2
"""Share of the stops in which a hand may have shifted the sensor."""
HANDLED = 4.0
"""Scatter of a block over that of most, above which the sensor is held by a hand."""
_MOTION, _BEYOND_NOISE, _UNSTEADY = 0.05, 1.5, 2.0
"""Scatter of the means of blocks over gravity, or over the spread of the positions, and over what fast noise leaves in them,
above which a stretch is motion: a sensor that turns by 0.05 rad has a mean 1.3 mg short of gravity. Steps between neighbouring
blocks over what noise leaves: 1 of white noise or a vibration, below 2 of flicker, 5 to 8 of a hand at 0.2 to 2 Hz, 2 to 3 of
one that also shakes."""
_BLOCK_S, _PARTS = 0.2, 4
"""Block of such a mean, s, which a vibration of a machine leaves nearly without a trace; and the parts that tell its noise."""
_TURN_PER_S, _TURN_SIGMAS, _POSES = 0.01, 4.0, 10.0
"""Change of the mean in a second over gravity, above which a stretch turns: a temperature moves it by a twentieth of that; its
standard errors that show it; and scatter over which gravity has to stand, in counts the only sign that the sensor was turned."""
_HELD_S, _HELD_SHARE, _HELD_G = 1.0, 0.5, 0.1
"""Time to the next stop, s, length over that of it, and distance of their means over gravity, below which a stretch is the end of
a slow move, in a hand: the same position, before the sensor is put down."""
_NEARLY, _CONTAMINATED = 0.94, 3.0
"""Part of the longest time at rest that a longer window has to find; its quietest scatter over that of the quietest window."""
_ENOUGH = 6
"""Stops from which a longer window is preferred: the faces of a cube."""


_AT_REST = 0.5
"""Part of a labelled stretch inside found stops, from which it is at rest: a search leaves its ends out."""


@dataclass(frozen=True)
class Stretches:
    """Static stretches: first sample and index past the last, and label of each; remarks on how they were found."""

    spans: tuple[tuple[int, int], ...]
    labels: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.spans)

    def only(self, numbers: Sequence[int]) -> "Stretches":
        """Some of them, by their numbers from 0."""
        return Stretches(tuple(self.spans[k] for k in numbers), tuple(self.labels[k] for k in numbers), self.remarks)


@dataclass(frozen=True)
class Stops:
    """Stops of a record: the window by which they were found, s; the numbers of those that hold several positions.

    threshold : scatter of a window that means motion; None: found in the record · rest_s : time at rest with what was
        taken off the ends, less that which was motion
    """

    window_s: float
    found: Stretches
    several: tuple[int, ...]
    threshold: float | None = None
    rest_s: float = 0.0

    @property
    def is_clean(self) -> bool:
        """Whether there are stops, each of one position, and more of them than motion."""
        return not self.several and len(self.found) > 0 and self.rest_s > 0.0


@dataclass(frozen=True)
class _SearchOptions:
    """Options of the search: window, s; shortest dwell, s; scatter that means motion."""

    window_s: float
    shortest_s: float
    threshold: float | None


def stretches(
    labels: Sequence[str] | None,
    output: Array,
    time: Array,
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
        intervals = by_positions(output, mapping.positions, where)
    elif mapping.block_s is not None:
        intervals = _by_blocks(time, edges, mapping.block_s)
        intervals = _without_handled_ends(intervals, output, time) if mapping.face else intervals
    else:
        how = _SearchOptions(mapping.window_s or 1.0, mapping.shortest_s or 1.0, mapping.threshold)
        gravity = GRAVITY.get(mapping.units.output)
        intervals = _put_down(
            _at_rest(_searched(output, time, edges, how), output, time, gravity), output, time, gravity
        )
        intervals = _of_one_position(intervals, output, time, edges, where, gravity)
    return _named(intervals, mapping, where)


def found_stops(output: Array, time: Array, edges: Sequence[int], gravity: float | None) -> Stops:
    """The stops of a record that was turned by hand, with the longest window that takes none of several positions for one.

    Parameters
    ----------
    edges : 0, the samples before which some are missing, and their number
    gravity : in the unit of the output; None of counts
    """
    stops = _best_stops(output, time, edges, gravity)
    return replace(stops, found=_put_down(stops.found, output, time, gravity)) if stops.is_clean else stops


def _best_stops(output: Array, time: Array, edges: Sequence[int], gravity: float | None) -> Stops:
    quiet = _quiet(output, time)
    least = min(quiet.values(), default=0.0)
    plain = [_stops(output, time, edges, _SearchOptions(window, window, None), gravity) for window in WINDOWS_S]
    # in a window that is too long for the stops it is never quiet
    fit = [stops for stops in plain if quiet.get(stops.window_s, least) <= _CONTAMINATED * least]
    clean = [stops for stops in fit if stops.is_clean]
    best = _longest(clean) if clean else None
    if best and (len(best.found) >= _ENOUGH or not any(stops.several for stops in fit)):
        return best
    # a hand that rests for a moment shakes little less than a moving hand: stricter limits part what it runs together
    strict = [
        _stops(output, time, edges, _SearchOptions(window, window, float(f"{times * sd:.3g}")), gravity)
        for window, sd in quiet.items()
        for times in STRICT
    ]
    clean = [stops for stops in strict if stops.is_clean and len(stops.found) >= _ENOUGH]
    if not clean:
        return max(plain, key=lambda stops: len(stops.found) - len(stops.several))
    return _longest(clean)


def _longest(clean: Sequence[Stops]) -> Stops:
    """The longest window that finds nearly all of the time at rest; what a short one finds in a motion beside it is brief."""
    nearly = _NEARLY * max(stops.rest_s for stops in clean)
    return next(stops for stops in clean if stops.rest_s >= nearly)


def _stops(output: Array, time: Array, edges: Sequence[int], how: _SearchOptions, gravity: float | None) -> Stops:
    searched = _searched(output, time, edges, how)
    found = _at_rest(searched, output, time, gravity)
    several = tuple(k for k, (a, b) in enumerate(found.spans) if change_of_level.several_levels(output[a:b]) > 1)
    rest = 2.0 * _time_of(found, time, how.window_s) - _time_of(searched, time, how.window_s)
    return Stops(how.window_s, found, several, how.threshold, rest)


def _time_of(found: Stretches, time: Array, window_s: float) -> float:
    return float(sum(time[b - 1] - time[a] + window_s for a, b in found.spans))


def _quiet(output: Array, time: Array) -> dict[float, float]:
    """The windows of the search that the record is long enough for, s, and the scatter in the quietest stretch of each."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    usable = [window for window in WINDOWS_S if _has_windows(len(output), window, rate)]
    return {window: static_intervals.quiet_sd(output, rate, window) for window in usable}


def _by_labels(labels: Sequence[str], edges: list[int]) -> Stretches:
    names = np.asarray(labels, dtype=object)
    first = sorted({*(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist(), *edges[:-1]})
    return Stretches(tuple(pairwise([*first, names.size])), tuple(str(names[k]) for k in first))


def labelled(labels: Sequence[str], edges: list[int], found: Stretches) -> tuple[Stretches, bool]:
    """The stretches of a label that lie in found stops for the most part, and whether all do: a label may mark the moves."""
    named = _by_labels(labels, edges)
    still = np.zeros(len(labels), dtype=bool)
    for first, last in found.spans:
        still[first:last] = True
    resting = [k for k, (first, last) in enumerate(named.spans) if np.mean(still[first:last]) >= _AT_REST]
    return named.only(resting), len(resting) == len(named)


def _by_blocks(time: Array, edges: list[int], block_s: float) -> Stretches:
    number = np.floor((time - time[0]) / block_s).astype(np.int64)
    first = sorted({*(np.flatnonzero(np.diff(number)) + 1).tolist(), *edges[:-1]})
    return Stretches(tuple(pairwise([*first, time.size])), tuple(f"block {k}" for k in range(len(first))))


def _without_handled_ends(intervals: Stretches, output: Array, time: Array) -> Stretches:
    """The blocks of a still record without those at its ends in which a hand still holds the sensor; a remark on these."""
    scatter = np.array([float(np.linalg.norm(output[a:b].std(axis=0))) for a, b in intervals.spans])
    calm = np.flatnonzero(scatter <= HANDLED * np.median(scatter))
    still = intervals.only(range(int(calm[0]), int(calm[-1]) + 1)) if calm.size else intervals
    if len(still) == len(intervals):
        return intervals
    remark = handling_left_out(still, time, (bool(calm[0] > 0), bool(calm[-1] + 1 < len(intervals))))
    return replace(still, remarks=(remark,))


def handling_left_out(still: Stretches, time: Array, ends: tuple[bool, bool]) -> str:
    """A sentence on the motion before the first stretch and after the last, which no dwell has; empty where there is none.

    Parameters
    ----------
    ends : whether there is such motion at the beginning, and at the end
    """
    first, last, end = (float(time[k] - time[0]) for k in (still.spans[0][0], still.spans[-1][1] - 1, len(time) - 1))
    spans = [f"0 to {first:.1f} s"] if ends[0] else []
    spans += [f"{last:.1f} to {end:.1f} s"] if ends[1] else []
    return f"handling at the ends left out: {' and '.join(spans)}" if spans else ""


def by_positions(output: Array, count: int, where: str) -> Stretches:
    """The positions of a record without moves between them, divided at the ``count`` − 1 largest changes."""
    try:
        levels = change_of_level.levels(output, count)
    except ValueError as problem:
        raise DataRejected(f"{where}: {problem}") from None
    # the samples beside a change may belong to either side
    start, stop = levels.start + (levels.start > 0), levels.stop - (levels.stop < len(output))
    remark = f"{len(levels)} positions logged back to back, {100.0 * levels.explained:.4g} % of the scatter explained by them"
    names = tuple(f"position {k}" for k in range(len(levels)))
    return Stretches(tuple(zip(start.tolist(), stop.tolist(), strict=True)), names, (remark,))


def _searched(output: Array, time: Array, edges: Sequence[int], how: _SearchOptions) -> Stretches:
    spans: list[tuple[int, int]] = []
    if len(edges) > 2 and how.threshold is None and time[-1] > time[0]:  # one limit for all parts of a record
        rate = (len(time) - 1) / float(time[-1] - time[0])
        if _has_windows(len(output), how.window_s, rate):
            how = replace(how, threshold=static_intervals.find(output, rate, window_s=how.window_s).threshold_sd)
    for a, b in pairwise(edges):
        if b - a < 3 or time[b - 1] <= time[a]:
            continue
        rate = (b - a - 1) / float(time[b - 1] - time[a])
        if not _has_windows(b - a, how.window_s, rate):
            continue
        piece = static_intervals.find(
            output[a:b], rate, window_s=how.window_s, shortest_s=how.shortest_s, threshold=how.threshold
        )
        spans += zip((piece.start + a).tolist(), (piece.stop + a).tolist(), strict=True)
    return Stretches(tuple(spans), tuple(f"dwell {k}" for k in range(len(spans))))


def _at_rest(intervals: Stretches, output: Array, time: Array, gravity: float | None) -> Stretches:
    """The stretches of three axes without those that are motion throughout, as in a record without rest; a remark on these."""
    if output.shape[1] < len(AXES) or not len(intervals):
        return intervals
    # a mean in counts has an offset of any size: between positions it cancels
    means = np.array([output[a:b].mean(axis=0) for a, b in intervals.spans])
    size = float(np.linalg.norm(means.std(axis=0))) if gravity is None else gravity
    resting = [
        k
        for k, (a, b) in enumerate(intervals.spans)
        if not _is_motion(output[a:b], float(time[b - 1] - time[a]), size, is_gravity=gravity is not None)
    ]
    if len(resting) == len(intervals):
        return intervals
    samples = np.array([b - a for a, b in intervals.spans])
    # the limit divides nothing: what is left is the calmer part of a motion
    if 2 * samples[resting].sum() <= samples.sum():
        resting = []
    count = len(intervals) - len(resting)
    remark = f"{count} of {len(intervals)} stretches are no rest and were left out: more scatter than noise"
    return replace(intervals.only(resting), remarks=(*intervals.remarks, remark))


def _put_down(found: Stretches, output: Array, time: Array, gravity: float | None) -> Stretches:
    """The stretches without those in a hand that has the position of the next one, before it puts the sensor down."""
    if len(found) < 2:
        return found
    means = np.array([output[a:b].mean(axis=0) for a, b in found.spans])
    size = float(np.linalg.norm(means.std(axis=0))) if gravity is None else gravity
    held = [
        b - a < _HELD_SHARE * (d - c)
        and time[c] - time[b - 1] < _HELD_S
        and float(np.linalg.norm(means[k + 1] - means[k])) < _HELD_G * size
        for k, ((a, b), (c, d)) in enumerate(pairwise(found.spans))
    ]
    return found.only([k for k in range(len(found)) if k == len(held) or not held[k]])


def _is_motion(x: Array, duration_s: float, size: float, *, is_gravity: bool) -> bool:
    """Whether the slow part of a stretch (n, 3) is motion.

    Parameters
    ----------
    size : gravity, or the spread of the positions of the record, which is small where there is one: there a drift in minutes is
        told from motion by the steps between neighbouring blocks
    """
    if _turns(x, duration_s, size):
        return True
    part_s = min(_BLOCK_S, duration_s / _PARTS) / _PARTS
    parts = _means(x, max(1, int(part_s / duration_s * (len(x) - 1))) if duration_s > 0.0 else 1)
    few = len(parts) < _PARTS**2
    blocks, noise = (
        (x, float(np.linalg.norm(change_of_level.neighbour_noise(x))))
        if few
        else (_means(parts, _PARTS), _steps(parts) / np.sqrt(_PARTS))
    )
    slow = float(np.linalg.norm(blocks.std(axis=0, ddof=1)))
    moving = (
        slow > _MOTION * size and slow > _BEYOND_NOISE * noise and (is_gravity or _steps(blocks) > _UNSTEADY * noise)
    )
    return moving and change_of_level.several_levels(x) == 1  # several positions back to back are told as such


def _turns(x: Array, duration_s: float, size: float) -> bool:
    """Whether the mean of a stretch moves through it, faster than a temperature moves it and than its scatter allows."""
    position = np.linspace(-0.5, 0.5, len(x))
    slope = 12.0 * (position @ x) / (len(x) + 2)  # over the stretch; Σ place² = n/12 within 1/n
    left = x - x.mean(axis=0) - position[:, None] * slope
    scatter = float(np.sqrt(np.sum(np.mean(left**2, axis=0))))
    turned = float(np.linalg.norm(slope))
    clear = turned > _TURN_SIGMAS * scatter * np.sqrt(12.0 / len(x))
    return clear and turned > _TURN_PER_S * size * duration_s and size > _POSES * scatter


def _means(x: Array, samples: int) -> Array:
    count = len(x) // samples
    return x[: count * samples].reshape(count, samples, x.shape[1]).mean(axis=1)


def _steps(means: Array) -> float:
    """Scatter of means (n, 3) by the differences of neighbours: their Allan deviation, all axes together."""
    return float(np.sqrt(np.sum(np.mean(np.diff(means, axis=0) ** 2, axis=0)) / 2.0))


def _has_windows(samples: int, window_s: float, rate: float) -> bool:
    """Whether there are as many samples as a search with this window needs."""
    return samples >= 3 * max(3, round(window_s * rate))


def _of_one_position(
    intervals: Stretches, output: Array, time: Array, edges: Sequence[int], where: str, gravity: float | None
) -> Stretches:
    """The stretches without a few that have more scatter than noise, as where a hand shifted the sensor; a remark on these.

    Raises
    ------
    DataRejected
        Many stretches do: positions were logged one after another.
    """
    counts = [change_of_level.several_levels(output[a:b]) for a, b in intervals.spans]
    several = [k for k, count in enumerate(counts) if count > 1]
    if not several:
        return intervals
    if len(several) <= _SHIFTED * len(intervals) and len(intervals) - len(several) >= _ENOUGH:
        ends = (intervals.spans[k] for k in several)
        spans = ", ".join(f"{time[a] - time[0]:.1f} to {time[b - 1] - time[0]:.1f} s" for a, b in ends)
        left = intervals.only([k for k in range(len(intervals)) if k not in several])
        return replace(left, remarks=(f"left out, since the sensor was shifted during the stop: {spans}",))
    worst = max(several, key=lambda k: counts[k])
    a, b = intervals.spans[worst]
    stops = found_stops(output, time, edges, gravity)
    if not stops.several and 2 * len(stops.found) > counts[worst]:
        offer = f"{options_of(stops)} finds {len(stops.found)} stops, one position in each"
    elif (total := change_of_level.several_levels(output)) > 1:
        offer = f"--set positions={total} divides the record at the changes"
    else:
        offer = f"{options_of(stops)} finds shorter dwells"
    raise DataRejected(
        f"{where}: rows {a + 1} to {b}: one dwell by its scatter, but about {counts[worst]} positions logged back to back by its "
        f"levels; a position per dwell is needed; {offer}, or map a column of labels as dwell=…"
    )


def options_of(stops: Stops) -> str:
    """The options of an import that find these stops."""
    limit = "" if stops.threshold is None else f" --set threshold={stops.threshold:g}"
    return f"--set window_s={stops.window_s:g} --set shortest_s={stops.window_s:g}{limit}"


def _named(intervals: Stretches, mapping: Mapping, where: str) -> Stretches:
    """The stretches with a label of a pose; all without poses."""
    if not mapping.poses:
        return intervals
    missing = [label for label in mapping.poses if label not in intervals.labels]
    if missing:
        raise DataRejected(
            f"{where}: no dwell is labelled '{missing[0]}' (in poses); {did_you_mean(missing[0], intervals.labels)}"
        )
    return intervals.only([k for k, label in enumerate(intervals.labels) if label in mapping.poses])
