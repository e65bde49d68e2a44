"""The lots of an archive for the evidence: scores of runs with the attributes of units and runs."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from datetime import datetime
from functools import cached_property
from typing import Any, cast

import numpy as np

from inertial.arrays import Array
from inertial.discovery.evidence import DATE, MEAN, SLOT, STATION, UNIT, ScoredLot
from inertial.discovery.naming import Pool
from inertial.discovery.scores import Column, LotScores, Products, indices
from pipelines.archive import Archive, Run
from pipelines.archive.attributes import Attributes, known_attributes
from pipelines.archive.locks import alone
from pipelines.archive.store import Place
from pipelines.certificates.ledger import Ledger
from pipelines.discovery.attributes import as_numbers
from pipelines.discovery.score_store import AXES, FOLDER, ScoreStore
from pipelines.discovery.scored_run import ScoredRun
from pipelines.parallel import Distributor
from pipelines.tables.dwells import measured
from schemas.errors import WrongUse, did_you_mean

SEASON, OPERATOR = "season", "operator"
OWN_TEMPCO = "own temperature coefficient"
"""A driver: an error of a unit's temperature reading changes its corrected output in proportion to this."""
_DECIMALS = 3  # decimals of a force in g, to which poses are equal


class DiscoveryArchive:
    """The lots of an archive, for the discovery of hidden effects.

    Parameters
    ----------
    device : kind of device; that of most runs if empty
    change : function that is applied to every lot before it is judged
    """

    def __init__(
        self, archive: Archive, device: str = "", change: Callable[[ScoredLot], ScoredLot] = lambda lot: lot
    ) -> None:
        archive.refuse_none()
        self.archive, self.store, self.change = archive, ScoreStore(archive), change
        self._device = device

    def with_change(self, change: Callable[[ScoredLot], ScoredLot]) -> "DiscoveryArchive":
        """The same archive with another change of its lots."""
        other = copy(self)
        other.change = change
        return other

    @cached_property
    def infos(self) -> list[Any]:
        """Finished runs with dwells in the order of their start; of the re-runs only the fits of imports."""
        stages = ({"reduce", "import"}, {"import"})
        return [
            info for info in self.archive.runs() if info.finished and stages[bool(info.rerun_of)] & set(info.stages)
        ]

    @cached_property
    def _imports(self) -> dict[str, str]:
        """For each fit of an import the run that imported its dwells; it is one lot with all its fits."""
        first: dict[str, str] = {}
        for run, source in ((info.id, str(info.rerun_of)) for info in self.infos if info.rerun_of):
            first[run] = first.get(source, source)
        return first

    @cached_property
    def _devices(self) -> Counter[str]:
        """The number of lots of each kind of device."""
        return Counter(info.device for info in self.infos if info.id not in self._imports)

    @cached_property
    def device(self) -> str:
        """The kind of device that is judged: the given one, else that of most runs."""
        counts = self._devices
        if self._device:
            wanted = next((count for count in counts if count.lower() == self._device.lower()), None)
            if wanted is None:
                raise WrongUse(
                    f"discover: --device '{self._device}' has no run in {self.archive.root}; {did_you_mean(self._device, counts)}"
                )
            return wanted
        if not counts:
            raise WrongUse(
                f"discover: {self.archive.root} has no run with dwells, thirty at least are needed; see 'tumbleline demo "
                "--lots N'"
            )
        return counts.most_common(1)[0][0]

    @property
    def other_devices(self) -> dict[str, int]:
        """Runs of other kinds of devices, which are never pooled with it."""
        return {device: count for device, count in self._devices.items() if device != self.device}

    def day_of(self, run: str) -> str:
        """The day of measurement of a run."""
        return str(self.store.heads[run]["when"])[:10]

    def score(self, workers: int, distribute: Distributor | None = None) -> int:
        """Score the runs without scores; returns their number."""
        with alone(self.archive.root / FOLDER, wait=True):
            return self.store.add([info.id for info in self.infos], workers, distribute)

    @cached_property
    def attributes(self) -> Attributes:
        """The attributes of units and runs."""
        return known_attributes(self.archive)

    def known_until(self, when: str) -> None:
        """Judge the next lots by the attributes that were known at a time; empty: by all."""
        self.attributes = known_attributes(self.archive, when)
        self.__dict__.pop("_quantities", None)

    @cached_property
    def revoked(self) -> set[str]:
        """Runs with a revoked calibration."""
        return {calibration.run for calibration in Ledger(self.archive).all() if calibration.state == "revoked"}

    def pooled(self) -> list[str]:
        """Runs of the device that have scores, in the order of arrival."""
        return [run for run, reason in self._reasons() if not reason]

    def left_out(self) -> list[tuple[str, str]]:
        """Runs of the device that are not pooled, with the reason."""
        return [(run, reason) for run, reason in self._reasons() if reason]

    def _reasons(self) -> Iterator[tuple[str, str]]:
        """Runs of the device with scores, in the order of arrival, with the reason if left out, else empty.

        An import counts by the first of its fits that can be pooled; where none can, the last states the reason.
        """
        lots = dict[str, tuple[str, str]]()
        for run, head in self.store.heads.items():
            lot = self._imports.get(run, run)
            if head["device"] == self.device and lots.get(lot, ("", "-"))[1]:
                lots.pop(lot, None)  # a lot arrives with the run that it counts by
                lots[lot] = run, head["left_out"]
        first = dict[int, str]()
        for run, reason in lots.values():
            prints = () if reason else self.store.heads[run]["prints"]
            twin = next((first[known] for known in prints if known in first), "")
            first |= {} if twin else dict.fromkeys(prints, run)
            yield run, f"its dwells are those of {twin}, which counts" if twin else reason

    @cached_property
    def _products(self) -> Products:
        return Products.mean(self.store.products)

    @property
    def columns(self) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
        """All columns of the sensor and all of the station that occur in any run of the archive."""
        return self._products.columns, self._products.station

    def lots(self, runs: Iterable[str]) -> Iterable[tuple[ScoredLot, ScoredLot]]:
        """For each run the lot of its sensors, and that of its station."""
        for run in runs:
            scored = self.store.run(run)
            yield self.lot_of(scored), self._of_station(scored)

    def lot_of(self, run: ScoredRun) -> ScoredLot:
        """A run as a lot, in the order of the archive's hypotheses."""
        scores, k = cast("LotScores", run.scores), len(self.columns[0])  # only runs with scores are pooled
        at = indices(self.columns[0], scores.products.columns)

        def spread(values: Array) -> Array:
            out = np.zeros((*values.shape[:-1], AXES, k))
            out[..., at] = values.reshape(*values.shape[:-1], AXES, at.size)
            return out.reshape(*values.shape[:-1], -1)

        levels, numbers = self._drivers(run)
        slopes = {OWN_TEMPCO: np.repeat(scores.tempco, k, axis=1)} if np.isfinite(scores.tempco).all() else {}
        every = spread(scores.score), spread(scores.own), spread(scores.information)
        return self.change(ScoredLot(run.run, run.station, _day(run.when), run.units, *every, levels, numbers, slopes))

    def _of_station(self, run: ScoredRun) -> ScoredLot:
        scores, sums = cast("LotScores", run.scores), np.zeros((2, len(self.columns[1])))
        sums[:, indices(self.columns[1], scores.products.station)] = scores.of_station
        score, information = sums
        return ScoredLot(run.run, run.station, _day(run.when), ("",), score[None], information[None], information)

    @cached_property
    def pool(self) -> Pool:
        """The columns of all effects and their products, averaged over the runs of the archive."""
        return Pool(self._products)

    def _drivers(self, run: ScoredRun) -> tuple[dict[str, tuple[str, ...]], dict[str, Array]]:
        levels: dict[str, tuple[str, ...]] = {SLOT: run.slots} if any(run.slots) else {}
        if run.who:
            levels[OPERATOR] = (run.who,) * len(run.units)
        levels[SEASON] = (f"month {int(run.when[5:7])}",) * len(run.units)
        numbers: dict[str, Array] = {}
        for name, known in self._quantities.items():
            values = tuple(self.attributes.of(unit, run.run, name) for unit in run.units)
            if not any(values):
                continue
            if known is None:
                levels[name] = values
            else:
                numbers[name] = np.array([known.get(value, np.nan) for value in values])
        return levels, numbers

    @cached_property
    def _quantities(self) -> dict[str, dict[str, float] | None]:
        """For each attribute that is a driver its numbers; None for labels."""
        names = (name for name in self.attributes.names() if name not in {MEAN, STATION, SLOT, UNIT, DATE})
        return {name: as_numbers(self.attributes.values(name)) for name in names}

    def earlier(self, order: Sequence[str]) -> Callable[[str, int], tuple[Array, Array] | None]:
        """A function of unit and n: score and information (h,) of the unit within the first n lots; None if unmeasured.

        Parameters
        ----------
        order : the lots of the evidence, which grows while they are added
        """
        index: dict[str, tuple[int, ...]] = {}
        known = 0

        def of(unit: str, taken: int) -> tuple[Array, Array] | None:
            nonlocal known
            for number in range(known, len(order)):
                for serial in self.store.heads[order[number]]["units"]:
                    index[serial] = (*index.get(serial, ()), number)
            known = len(order)
            before = [order[k] for k in index.get(unit, ()) if k < taken]
            if not before:
                return None
            lots = (self.lot_of(self.store.run(run)) for run in before)
            score, information = np.sum([np.stack(lot.inside)[:, lot.units.index(unit)] for lot in lots], axis=0)
            return score, information

        return of

    def poses(self, run: str) -> Array:
        """Forces (n, 3), g, of the distinct poses of a run."""
        force = measured(Run(self.archive, run).table("dwells")).state.force.reshape(-1, 3)
        return np.unique(np.round(force, _DECIMALS), axis=0)

    def folder(self) -> Place:
        """Folder of the evidence of the device."""
        return self.archive.root / FOLDER / re.sub(r"[^A-Za-z0-9._-]", "_", self.device)


def _day(when: str) -> float:
    return datetime.fromisoformat(when).timestamp() / 86400.0
