"""What is no noise in a record at rest: spikes, louder and stuck stretches, jumps, a warm-up. No terms of noise describe them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from inertial.arrays import NORMAL_MEDIAN, Array, Flags, Index, runs_of
from inertial.record_faults import frozen

NEIGHBOURS = 7  # samples of the running median
FAR = 8.0
"""Standard deviations of a sample or of a block's variance that are no chance: 1e-15 of normal ones."""
BESIDE, MANY = 32, 8  # samples between those of a burst, at most, and those of the shortest burst
MATERIAL = 0.05
"""Share of the white variance from which on spikes or a louder stretch count: N is 2.5 % larger by it."""
BLOCKS, SHORTEST_BLOCK = 128, 64
LOUDER = 1.5  # of the variance of a block over the usual one
BRIEF = (8, 32)  # samples of a short burst, over which its power is a mean
CAPPED = 5.0  # standard deviations to which a sample counts in it: one or two of heavy tails make no burst
RARE = 6.0
"""Standard deviations of the cube root of such a mean that are rare: of normal noise 1e-9 of them."""
FEWEST_BURSTS = 3  # of which a cause that comes again, as steps on the floor, is told: one or two may be spikes
JUMP = 7.0
"""Standard deviations of a change of the mean: 3e-12 of normal ones, with the spread known to a fifth."""
SHORTEST, FEWEST = 16, 32  # samples of a mean, and means of a record by whose changes their spread is known
SETTLES, SETTLED = 7.0, 0.15
"""Standard deviations of later changes that a first change is no chance from, and its share that a settled record may still have:
none of 5200 records of 13 kinds of noise, drift and wave but a cubic drift, which settles."""
MEANS = (32, 64, 128, 256)  # of a record, whose first changes are compared with those of its second half
SHARP = 2.0
"""Growth of the change over four times the span below which it is a jump: a drift grows four times, a jump not at all."""


@dataclass(frozen=True)
class Disturbance:
    """A part of a record that its noise does not explain.

    kind : ``spikes``, ``loud``, ``bursts``, ``stuck``, ``jump`` or ``settling``
    start, stop : samples, from the first to behind the last; of a jump where it is
    count : of spikes, of bursts, or of samples
    size : largest spike or sample of a burst, change of the mean or while it settles, or standard deviation; unit of the record
    material : whether terms of noise would be wrong by it
    """

    kind: str
    start: int
    stop: int
    count: int
    size: float
    material: bool = True


def disturbances(record: Array) -> list[Disturbance]:
    """Spikes, bursts, louder stretches, jumps and the warm-up of a record (n,) at rest, each by what is usual in the rest of it.

    Noise of any colour whose steps are normal has none of them, nor a steady drift or a slow wave. Spikes and loud stretches
    count only where they change the white noise; short bursts that come again are told in any case.
    """
    quick = record - median_filter(record, NEIGHBOURS, mode="nearest")
    spread = max(_spread(quick), _spread(np.diff(record)) / np.sqrt(2.0))
    far = np.abs(quick) > FAR * spread if spread > 0.0 else np.zeros(record.size, dtype=bool)  # 0: coarse digits
    rest = np.where(far, 0.0, quick)
    found = [Disturbance("stuck", run.start, run.stop, run.count, 0.0) for run in frozen(record[:, None])]
    found += [
        Disturbance("loud", int(a), int(b), int(b - a), float(np.std(quick[a:b])))
        for a, b in zip(*runs_of(_bursts(far) | _loud(rest)), strict=True)
    ]
    within: Flags = np.zeros(record.size, dtype=bool)
    for disturbance in found:
        within[max(disturbance.start - BESIDE, 0) : disturbance.stop + BESIDE] = True
    rows = np.flatnonzero(far & ~within)
    if float(np.sum(quick[rows] ** 2)) > MATERIAL * float(np.sum(rest**2)):
        worst = float(quick[rows[np.argmax(np.abs(quick[rows]))]])
        found.insert(0, Disturbance("spikes", int(rows[0]), int(rows[-1]) + 1, rows.size, worst))
        within[rows] = True
    found += _brief(np.where(within, 0.0, quick), float(np.sum(rest**2)))
    quiet = record - np.where(far, quick, 0.0)
    jumps = [jump for jump in _jumps(quiet) if not within[jump.start]]
    return [*found, *jumps, *([] if jumps else _settling(quiet))]


def disturbance_texts(found: Sequence[Disturbance], rate_hz: float, unit: str) -> list[str]:
    """What is said of the disturbances of a channel sampled at ``rate_hz``, a text for each kind; ``unit``: of the record."""
    texts: list[str] = []
    for kind, of_kind in (
        (kind, [item for item in found if item.kind == kind]) for kind in dict.fromkeys(item.kind for item in found)
    ):
        first, more = of_kind[0], f" (and {len(of_kind) - 1} more)" if len(of_kind) > 1 else ""
        start, stop, size = first.start / rate_hz, first.stop / rate_hz, f"{first.size:+.3g} {unit}".strip()
        texts.append(
            {
                "spikes": f"{first.count} spikes between {start:.6g} and {stop:.6g} s, the largest {size}",
                "stuck": f"the output repeats itself from {start:.6g} to {stop:.6g} s{more}",
                "loud": f"the noise is louder from {start:.6g} to {stop:.6g} s{more}",
                "bursts": f"{first.count} short bursts or more between {start:.6g} and {stop:.6g} s, the largest {size}",
                "jump": f"the mean jumps by {size} at {start:.6g} s{more}",
                "settling": f"the mean settles by {size} in the first {stop:.6g} s, as in a warm-up: leave them out",
            }[kind]
        )
    return texts


def _bursts(far: Flags) -> Flags:
    """Stretches of many samples that are far off, close to each other."""
    samples, burst = np.flatnonzero(far), np.zeros(far.size, dtype=bool)
    for group in np.split(samples, np.flatnonzero(np.diff(samples) > BESIDE) + 1):
        if group.size >= MANY:
            burst[group[0] : group[-1] + 1] = True
    return burst


def _spread(values: Array) -> float:
    """Standard deviation of values (n,) by the median of their magnitudes about their median."""
    return float(np.median(np.abs(values - np.median(values)))) / NORMAL_MEDIAN


def _loud(quick: Array) -> Flags:
    """Stretches whose quick noise is far above the usual one: found by blocks, with the edges where the likelihood has them."""
    loud = np.zeros(quick.size, dtype=bool)
    size = max(quick.size // BLOCKS, SHORTEST_BLOCK)
    count = quick.size // size
    if count < FEWEST:
        return loud
    power = (quick[: count * size].reshape(count, size) ** 2).mean(axis=1)
    usual = float(np.median(power))
    scatter = max(_spread(power), usual * np.sqrt(2.0 / size))
    louder = (power > LOUDER * usual) & (power - usual > FAR * scatter)
    if float(np.sum(power[louder] - usual)) > MATERIAL * count * usual:
        for first, last in zip(*runs_of(louder), strict=True):
            high = float(power[first:last].max())
            # of each sample, by how much more likely it is of the louder noise than of the usual one
            gain = 0.5 * (quick**2 * (1.0 / usual - 1.0 / high) - np.log(high / usual))
            begin, end = max(first - 1, 0) * size, min(last + 1, count) * size
            start = begin + int(np.argmax(np.cumsum(gain[begin : (first + 1) * size][::-1])[::-1]))
            middle = (last - 1) * size
            loud[start : middle + 1 + int(np.argmax(np.cumsum(gain[middle:end])))] = True
    return loud


def _brief(quick: Array, total: float) -> list[Disturbance]:
    """Short bursts that come again, as one disturbance, from a record's quick part (n,) without what is told otherwise.

    The cube root of a mean square is nearly normal (Wilson and Hilferty), so that its own spread over the record tells what is
    usual, whatever the correlation of the noise.

    Parameters
    ----------
    total : sum of the squares of the record's noise
    """
    inside: Flags = np.zeros(quick.size, dtype=bool)
    most = CAPPED * _spread(quick)
    capped = np.clip(quick, -most, most)
    for size in BRIEF:
        if quick.size < FEWEST * size:
            break
        root = np.cbrt(np.convolve(capped**2, np.full(size, 1.0 / size), "valid"))
        spread = _spread(root)
        for start in np.flatnonzero(root - np.median(root) > RARE * spread) if spread > 0.0 else ():
            inside[start : start + size] = True
    starts, stops = runs_of(inside)
    if not starts.size:
        return []
    apart = np.concatenate([[True], starts[1:] - stops[:-1] > BESIDE])
    if np.count_nonzero(apart) < FEWEST_BURSTS:
        return []
    largest = float(quick[inside][np.argmax(np.abs(quick[inside]))])
    material = float(np.sum(quick[inside] ** 2)) > MATERIAL * total
    return [Disturbance("bursts", int(starts[0]), int(stops[-1]), int(np.count_nonzero(apart)), largest, material)]


def _jumps(record: Array) -> list[Disturbance]:
    """Changes of the mean that are as sudden as can be told, the largest first."""
    sums = np.concatenate([[0.0], np.cumsum(record - record.mean())])
    found: list[tuple[float, Disturbance]] = []
    taken: Flags = np.zeros(record.size, dtype=bool)
    digits, counts = np.unique(record, return_counts=True)
    changing = 1.0 - float(counts.max()) / record.size if digits.size > 1 else 1.0
    span = 2 ** int(np.ceil(np.log2(SHORTEST / changing)))  # of coarse digits, as long as means of them are normal
    while FEWEST * span <= record.size:
        at = np.arange(span, record.size - span + 1, max(span // 4, 1))
        change = _changes(sums, at, span)
        middle, spread = float(np.median(change)), _spread(change)
        far = np.flatnonzero(np.abs(change - middle) > JUMP * spread) if spread > 0.0 else np.zeros(0, dtype=int)
        for group in np.split(far, np.flatnonzero(np.diff(far) > 8) + 1):
            if not group.size:
                continue
            best = int(group[np.argmax(np.abs(change[group] - middle))])
            sample, size = int(at[best]), float(change[best] - middle)
            if taken[max(sample - span, 0) : sample + span].any() or not _sharp(sums, sample, span, size, spread):
                continue
            taken[max(sample - span, 0) : sample + span] = True
            found.append((abs(size) / spread, Disturbance("jump", sample, sample, 1, size)))
        span *= 2
    return [jump for _, jump in sorted(found, key=lambda pair: -pair[0])]


def _changes(sums: Array, at: Index, span: int) -> Array:
    """Mean of ``span`` samples from each index on, less that of as many before it."""
    return (sums[at + span] - 2.0 * sums[at] + sums[at - span]) / span


def _sharp(sums: Array, sample: int, span: int, size: float, spread: float) -> bool:
    """Whether a change has hardly grown over four times the span."""
    wide = min(4 * span, sample, sums.size - 1 - sample)
    if wide < 2 * span:
        return False
    change = float(_changes(sums, np.array([sample]), wide)[0])
    return abs(change) < SHARP * abs(size) * (wide / span) / 4.0 + 3.0 * spread


def _settling(record: Array) -> list[Disturbance]:
    """The beginning of a record whose mean moves there as nowhere later, and moves no more then; empty where there is none.

    The changes of a random walk, of flicker and of a steady drift are alike at all times. Those of a device that warms up fade.
    """
    clearest, found = SETTLES, list[Disturbance]()
    for count in MEANS:
        size = record.size // count
        if size < SHORTEST:
            break
        changes = np.diff(record[: count * size].reshape(count, size).mean(axis=1))
        later = changes[count // 2 :]
        off, spread = changes - np.median(later), float(np.std(later, ddof=1))
        still = abs(float(np.median(off[count // 4 : count // 2])))
        if spread > 0.0 and abs(off[0]) > clearest * spread and still < SETTLED * abs(off[0]):
            clearest = float(abs(off[0]) / spread)
            end = size * (1 + int(np.argmax(off * np.sign(off[0]) < 2.0 * spread)))
            moved = float(np.mean(record[end : 2 * end]) - np.mean(record[: max(size // 16, SHORTEST)]))
            found = [Disturbance("settling", 0, end, end, moved)]
    return found
