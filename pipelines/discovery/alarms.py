"""The alarms of an archive, with the effect, day and present evidence of each, and the columns of all effects."""

from functools import cached_property

import numpy as np

from inertial.discovery.naming import Pool
from pipelines.discovery.evidence_state import Alarm, Evidences, hypothesis
from pipelines.discovery.figures_of_name import plain
from pipelines.discovery.lot_source import AXES, OWN_TEMPCO, DiscoveryArchive
from pipelines.discovery.nights import held


class Alarms:
    """The alarms of the evidence of one kind of device."""

    def __init__(self, source: DiscoveryArchive, state: Evidences) -> None:
        self.source, self.state = source, state

    @cached_property
    def open_alarms(self) -> list[Alarm]:
        """Alarms that are discoveries."""
        return [alarm for alarm in self.state.alarms if not held(self.state, alarm)]

    @cached_property
    def of_thermometer(self) -> list[Alarm]:
        """Alarms of effects proportional to a unit's own temperature coefficient, the strongest first."""
        alarms = (alarm for alarm in self.open_alarms if plain(alarm.driver) == OWN_TEMPCO)
        return sorted(alarms, key=lambda alarm: -self.log_e(alarm))

    @cached_property
    def pool(self) -> Pool:
        """The columns of all effects and their products, averaged over the runs of the archive."""
        columns, k = self.state.columns, len(self.state.columns)
        index = {column: at for at, column in enumerate(columns)}
        lot, inside, size = np.zeros((AXES * k, AXES * k)), np.zeros((AXES, k, k)), np.zeros((AXES, k))
        weight = np.zeros(k)
        for product in self.source.store.products:
            at = np.array([index[column] for column in product.columns if column in index])
            if at.size != len(product.columns):
                continue
            indices = (np.arange(AXES)[:, None] * k + at).reshape(-1)
            lot[np.ix_(indices, indices)] += product.runs * product.lot
            inside[:, at[:, None], at] += product.runs * product.inside
            size[:, at] += product.runs * product.size.reshape(AXES, -1)
            weight[at] += product.runs
        return Pool(columns, (size / np.maximum(weight, 1.0)).reshape(-1), lot, inside)

    def effect_of(self, alarm: Alarm) -> str:
        """Id of the effect of an alarm."""
        return hypothesis(self.state, alarm.index)[0]

    def day_of(self, alarm: Alarm) -> str:
        """The day of the lot that raised an alarm."""
        return str(self.source.store.head(self.state.order[min(alarm.lots, len(self.state.order)) - 1])["when"])[:10]

    def floors(self, size: float) -> float | None:
        """A size over the noise of a dwell of one lot."""
        floor = float(np.median([self.source.store.head(run)["floor"] for run in self.state.order]))
        return size / floor if floor > 0.0 else None

    def log_e(self, alarm: Alarm) -> float:
        """Logarithm of the evidence of an alarm's hypothesis now."""
        of_station = alarm.index >= self.state.sensor.size
        evidence = self.state.station if of_station else self.state.sensor
        return float(evidence.drivers[alarm.driver].log_e[alarm.index - (self.state.sensor.size if of_station else 0)])
