"""The effect of a model on the archive: yield and errors of all lots with old and new model, by station and kind of device."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.jobs.model_change import ModelChange
from pipelines.jobs.releases import keep_evidence
from pipelines.parallel import Distributor, map_partitions
from pipelines.rerun import lot_comparison
from pipelines.rerun.lot_comparison import Fresh, FreshTask, LotComparison, Sums
from pipelines.rerun.partition import parts

FALLS = 0.005  # smallest relative change of an error that counts
LEVEL = 0.05
"""Two-sided level of the verdict: units scatter as much, or more, in one of twenty archives where the models are equally good."""
FEWEST = 3  # units that can show a difference: two have one degree of freedom
BETTER, WORSE, EQUAL, NOTHING = "better", "worse", "no better", "nothing to judge"


def evaluated(
    archive: Archive,
    runs: Sequence[str],
    change: ModelChange,
    distribute: Distributor | None = None,
    workers: int = 1,
    report_progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """The what-if of a model over lots, stored in the archive as evidence; nothing of the lots themselves is changed.

    runs : of the archive, with the present and with the new model
    distribute, workers : where parts are computed, see :func:`pipelines.parallel.map_partitions`
    report_progress : gets what is computed next
    """
    report_progress("lots with both models")
    batches = parts(archive, list(runs), change, workers)
    portions = map_partitions(lot_comparison.judged, batches, distribute, workers=workers, name="what if")
    lots = list(chain.from_iterable(portions))
    report_progress("later runs of the same units")
    tasks = fresh_tasks(lots, archive.address, change)
    size = max(1, -(-len(tasks) // (4 * workers)))
    chunks = [tasks[start : start + size] for start in range(0, len(tasks), size)]
    done = map_partitions(lot_comparison.fresh, chunks, distribute, workers=workers, name="what if, fresh runs")
    document: dict[str, Any] = {
        "name": change.model_name,
        "version": change.model_version,
        "effects": list(change.effects or ()),
        "limits": change.limits_name or "as each lot had them",
        **summary(lots, list(chain.from_iterable(done))),
    }
    document["evidence"] = keep_evidence(archive, change, document, list(runs))
    return document


def fresh_tasks(lots: Sequence[LotComparison], archive: str, change: ModelChange) -> list[FreshTask]:
    """For every run, the calibrations from the previous run of each of its units."""
    last: dict[str, LotComparison] = {}
    tasks: list[FreshTask] = []
    by_run = {judged.entry.id: judged for judged in lots}
    for judged in (lot for lot in lots if lot.sides):
        earlier: dict[str, list[str]] = defaultdict(list)
        capture = judged.entry.capture
        for unit in judged.sides[1].fitted:
            # the dwells of a run are not fresh for another run of the same capture
            if unit in last and not (capture and last[unit].entry.capture == capture):
                earlier[last[unit].entry.id].append(unit)
            last[unit] = judged
        if earlier:
            old, new = ([by_run[run].sides[k].calibration for run in earlier] for k in (0, 1))
            pairs = tuple(zip(map(tuple, earlier.values()), old, new, strict=True))
            tasks.append(FreshTask(archive, judged.entry.id, change, pairs))
    return tasks


def summary(lots: Sequence[LotComparison], later: Sequence[Fresh]) -> dict[str, Any]:
    """The what-if as a document: total, by station and device, changed outcomes, failed lots, and a verdict."""
    by_run = {fresh.run: fresh for fresh in later}
    compared = [judged for judged in lots if judged.sides]
    groups: dict[tuple[str, str], list[LotComparison]] = defaultdict(list)
    for judged in compared:
        groups[judged.entry.station, judged.entry.device].append(judged)
    rows = [
        {"station": station, "device": device, **_figures(members, by_run)}
        for (station, device), members in sorted(groups.items())
    ]
    total = _figures(compared, by_run)
    verdict, explanation = _verdict(total, rows, compared, by_run)
    return {
        "lots": len(compared),
        "total": total,
        "groups": rows,
        "flips": _flips(compared),
        "failed": [{"run": judged.entry.id, "error": judged.error} for judged in lots if judged.error],
        "verdict": verdict,
        "words": explanation,
    }


def _figures(lots: Sequence[LotComparison], fresh: dict[str, Fresh]) -> dict[str, Any]:
    """Yield and root mean square errors of some lots, each [old, new]."""
    sides = [[judged.sides[k] for judged in lots] for k in (0, 1)]
    again = [fresh[judged.entry.id] for judged in lots if judged.entry.id in fresh]
    on_fresh = [[lot.old for lot in again], [lot.new for lot in again]]
    units = sum(len(side.outcome) for side in sides[0])
    passed = [sum(list(side.outcome.values()).count("pass") for side in of_model) for of_model in sides]
    return {
        "lots": len(lots),
        "units": units,
        "yield": [count / units if units else None for count in passed],
        "fit_rms_ug": [_rms([side.fitted for side in of_model]) for of_model in sides],
        "verification_rms_ug": [_rms([side.verified for side in of_model]) for of_model in sides],
        "fresh_rms_ug": [_rms(sums) for sums in on_fresh],
        "fresh_units": sum(len(sums) for sums in on_fresh[1]),
    }


def _rms(parts: Sequence[Sums]) -> float | None:
    squares = sum(square for part in parts for square, _ in part.values())
    count = sum(number for part in parts for _, number in part.values())
    return (squares / count) ** 0.5 if count else None


def _flips(lots: Sequence[LotComparison]) -> dict[str, list[dict[str, str]]]:
    """Units that pass with the old model only, and units that pass with the new model only."""
    flips: dict[str, list[dict[str, str]]] = {"to_fail": [], "to_pass": []}
    for judged in lots:
        old, new = judged.sides
        for unit, before in old.outcome.items():
            after = new.outcome.get(unit, "")
            passed = before == "pass"
            if passed != (after == "pass"):
                reasons = (new if passed else old).reasons[unit]
                row = {"run": judged.entry.id, "unit": unit, "old": before, "new": after, "reasons": reasons}
                flips["to_fail" if passed else "to_pass"].append(row)
    return flips


def _verdict(
    total: dict[str, Any], rows: Sequence[dict[str, Any]], lots: Sequence[LotComparison], fresh: dict[str, Fresh]
) -> tuple[str, str]:
    """Whether the new model is better, by the errors on data that were not fitted and their scatter over units."""
    figure = next(iter(_known(total)), "")
    if not figure:
        return NOTHING, "no lot has dwells that were not fitted; the models cannot be compared"
    before, after = total["yield"]
    old, new = map(_three, total[figure])
    yields = f"the yield from {100.0 * before:.0f} % to {100.0 * after:.0f} %"
    sentence = f"the error {WHERE[figure]} changes from {old} to {new} µg, {yields}"
    ratio = _log_ratios(figure, lots, fresh)
    count = number_of(int(ratio.size), "unit")
    if lost := sum(len(old.keys() - new.keys()) for old, new in _pairs(figure, lots, fresh)):
        return WORSE, f"{sentence}; {number_of(lost, 'calibration')} of units cannot be judged with the new model"
    if ratio.size < FEWEST:
        return EQUAL, f"{sentence}; {count} cannot show that this is more than scatter, {FEWEST} are needed"
    if not _differs(ratio, LEVEL):
        return EQUAL, f"{sentence}: the scatter of {count} explains as much"
    hurt: list[str] = []
    for row in rows:
        of_group = [lot for lot in lots if (lot.entry.station, lot.entry.device) == (row["station"], row["device"])]
        ratios = _log_ratios(figure, of_group, fresh)
        grown = figure in _known(row) and _share(row[figure]) > FALLS and ratios.size >= FEWEST and ratios.mean() > 0.0
        if grown and _differs(ratios, LEVEL / len(rows)):
            hurt.append(f"{row['device']} on {row['station']}")
    return _decided(_share(total[figure]), float(ratio.mean()), hurt, sentence)


def _decided(share: float, mean: float, hurt: Sequence[str], sentence: str) -> tuple[str, str]:
    """The verdict on a difference that is more than scatter; the root mean square and the typical unit must agree."""
    if share > FALLS and mean > 0.0:
        return WORSE, f"{sentence}: the error increases"
    if hurt:
        return WORSE, f"{sentence}; the error increases for {', '.join(hurt)}"
    if share < -FALLS and mean < 0.0:
        return BETTER, f"{sentence}: the error decreases"
    return EQUAL, f"{sentence}: the error does not decrease"


def _pairs(figure: str, lots: Sequence[LotComparison], fresh: dict[str, Fresh]) -> list[tuple[Sums, Sums]]:
    """Errors of the units of each lot, under the old and the new model."""
    if figure == "fresh_rms_ug":
        return [(later.old, later.new) for lot in lots if (later := fresh.get(lot.entry.id))]
    return [(old.verified, new.verified) for old, new in (lot.sides for lot in lots)]


def _log_ratios(figure: str, lots: Sequence[LotComparison], fresh: dict[str, Fresh]) -> NDArray[np.float64]:
    """Natural logarithm of new over old error, one value per unit: the mean of its calibrations that both models judge."""
    by_unit: dict[str, list[float]] = defaultdict(list)
    for old, new in _pairs(figure, lots, fresh):
        for unit in old.keys() & new.keys():
            (before, _), (after, _) = old[unit], new[unit]
            if before > 0.0 and after > 0.0:
                by_unit[unit].append(0.5 * float(np.log(after / before)))
    return np.array([float(np.mean(ratios)) for ratios in by_unit.values()])


def _differs(ratios: NDArray[np.float64], level: float) -> bool:
    """Whether the mean of the ratios differs from zero by more than they scatter (Student's t, two-sided)."""
    from scipy import stats

    spread = float(ratios.std(ddof=1)) if ratios.size > 1 else np.inf
    if spread == 0.0:
        return bool(ratios.mean() != 0.0)
    size = abs(float(ratios.mean())) * ratios.size**0.5 / spread
    return bool(2.0 * stats.t.sf(size, ratios.size - 1) < level)


WHERE = {"fresh_rms_ug": "on later runs", "verification_rms_ug": "in poses that were not fitted"}
"""Errors on data that were not fitted, by which a model is judged, the more telling first."""


def _known(row: dict[str, Any]) -> list[str]:
    return [name for name in WHERE if None not in row[name] and row[name][0]]


def _share(pair: Sequence[float]) -> float:
    return pair[1] / pair[0] - 1.0


def _three(value: float) -> str:
    """Three significant digits, without an exponent."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if abs(rounded) >= 1000.0 else f"{rounded:g}"
