"""Samples that an axis repeats, and torn words: refused, left out or used, by the mapping."""

from dataclasses import dataclass

import numpy as np

from inertial import record_faults
from inertial.arrays import Array, Flags, Index
from inertial.counts import number_of
from pipelines.importers.documents import FaultName, SampleFaultDocument
from pipelines.importers.mapping import Mapping
from pipelines.importers.stretches import Stretches
from schemas.errors import DataRejected
from schemas.units import AXES

_MOST_LISTED = 5


@dataclass(frozen=True)
class SampleFaults:
    """Faults of the samples of a record.

    frozen, torn : as found · bad : (n,), samples of either
    """

    frozen: tuple[record_faults.Frozen, ...]
    torn: tuple[record_faults.Torn, ...]
    bad: Flags

    def __bool__(self) -> bool:
        return bool(self.frozen or self.torn)

    def sentences(self, time: Array) -> list[str]:
        """The faults as text."""
        texts = [
            f"axis {AXES[stretch.axis]} is constant for {stretch.count} samples from row {stretch.start + 1} on "
            f"({time[stretch.start]:.6g} s)"
            for stretch in sorted(self.frozen, key=lambda stretch: -stretch.count)[:_MOST_LISTED]
        ]
        more = len(self.frozen) - _MOST_LISTED
        texts += [f"and {more} more such stretches"] if more > 0 else []
        return texts + [
            f"axis {AXES[fault.axis]} has torn words: {100.0 * fault.share:.3g} % of its resting samples deviate by "
            f"±{', ±'.join(map(str, fault.offsets))} steps of its resolution, from row {int(fault.rows.min()) + 1} on"
            for fault in self.torn
        ]

    def rows(self, time: Array) -> list[SampleFaultDocument]:
        """The faults for JSON."""
        found: list[tuple[FaultName, int, int, int, tuple[int, ...]]] = [
            *(("stuck_output", fault.axis, fault.start, fault.count, ()) for fault in self.frozen),
            *(("torn_words", fault.axis, int(fault.rows.min()), fault.rows.size, fault.offsets) for fault in self.torn),
        ]
        return [
            {"fault": fault, "axis": AXES[axis], "first_row": first + 1, "samples": count, "start_s": float(time[first]),
             "offsets_lsb": list(offsets)}
            for fault, axis, first, count, offsets in found
        ]  # fmt: skip


def look(output: Array) -> SampleFaults:
    """The faults of the samples of a record (n, 3)."""
    frozen, torn = tuple(record_faults.frozen(output)), tuple(record_faults.torn(output))
    bad = np.zeros(len(output), dtype=bool)
    for stretch in frozen:
        bad[stretch.start : stretch.stop] = True
    for fault in torn:
        bad[fault.rows] = True
    return SampleFaults(frozen, torn, bad)


def mended(output: Array, faults: SampleFaults, bad: Flags) -> Array:
    """The record (n, 3) for the search for dwells: torn words that are left out are replaced by the running median."""
    if not bad.any() or not faults.torn:
        return output
    clean = output.copy()
    for fault in faults.torn:
        clean[fault.rows, fault.axis] = record_faults.running_median(output[:, fault.axis])[fault.rows]
    return clean


def without_short(intervals: Stretches, record: Index) -> tuple[Stretches, Index, tuple[str, ...]]:
    """The dwells that keep at least half of their samples, renumbered, and a remark on the others."""
    sound = [k for k, (a, b) in enumerate(intervals.spans) if 2 * np.count_nonzero(record[a:b]) > b - a]
    if len(sound) == len(intervals):
        return intervals, record, ()
    numbers = np.zeros(len(intervals) + 1, dtype=np.int64)
    numbers[np.array(sound, dtype=np.int64) + 1] = np.arange(len(sound)) + 1
    gone = [intervals.labels[k] for k in range(len(intervals)) if k not in set(sound)]
    remark = f"dwells left out because most of their samples have faults: {', '.join(gone[:_MOST_LISTED])}"
    return intervals.only(sound), numbers[record], (remark,)


def sound_dwells(
    columns: dict[str, Array], labels: list[str], mapping: Mapping, where: str
) -> tuple[Flags, tuple[str, ...]]:
    """Which rows that are dwells already are used (n,), and a remark: those with an axis without scatter are faulty.

    Raises
    ------
    DataRejected
        There are such dwells and the mapping does not state their treatment.
    """
    sound = np.ones(len(labels), dtype=bool)
    if not all(f"sd_{axis}" in columns for axis in mapping.letters):
        return sound, ()
    spread = np.column_stack([columns[f"sd_{axis}"] for axis in mapping.letters])
    usual = np.median(spread, axis=0)
    still = (spread < 1e-6 * usual) & (usual > 0.0)
    rows = np.flatnonzero(still.any(axis=1))
    if not rows.size:
        return sound, ()
    first = int(rows[0])
    axis = AXES[int(np.argmax(still[first]))]
    size = f"no scatter, usually {usual[AXES.index(axis)]:.3g}"
    found = f"axis {axis} is constant in dwell '{labels[first]}' (row {first + 1}): {size}"
    if mapping.faulty == "refuse":
        raise DataRejected(
            f"{where}: {found} ({rows.size} such dwells); samples of the sensor are needed; measure them again, or add "
            "--set faulty=leave-out, or --set faulty=keep if this is what the sensor does"
        )
    if mapping.faulty == "leave-out":
        sound[rows] = False
    return sound, (
        f"{number_of(rows.size, 'dwell')} with a constant axis {'kept' if sound.all() else 'left out'}: {found}",
    )


def refuse_or_remark(faults: SampleFaults, output: Array, time: Array, mapping: Mapping, where: str) -> tuple[str, ...]:
    """Remarks on the faulty samples that are left out or used.

    Raises
    ------
    DataRejected
        There are faults and the mapping does not state their treatment; or an axis is always constant.
    """
    if not faults:
        return ()
    words = "; ".join(faults.sentences(time))
    constant = [stretch for stretch in faults.frozen if stretch.count == len(output)]
    if constant and mapping.faulty != "keep":
        axis = AXES[constant[0].axis]
        raise DataRejected(
            f"{where}: axis {axis} never changes in {len(output)} samples while another axis does; map another column as "
            f"{axis}, repair the sensor's channel, or import it all the same with --set faulty=keep"
        )
    if mapping.faulty == "refuse":
        raise DataRejected(
            f"{where}: {words}; samples of the sensor are needed; measure again, or add --set faulty=leave-out for what is "
            "sound, or --set faulty=keep if this is what the sensor does"
        )
    done = "left out" if mapping.faulty == "leave-out" else "kept"
    return (f"{int(faults.bad.sum())} samples with faults {done}: {words}",)
