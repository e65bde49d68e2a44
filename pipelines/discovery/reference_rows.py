"""Discoveries of errors of the references, not of the devices: columns of the station, and its thermometer."""

import numpy as np

from inertial.discovery.evidence import ALL, DATE, INSIDE, MEAN, SLOPE
from inertial.discovery.station_wander import over
from pipelines.discovery.alarms import Alarms
from pipelines.discovery.documents import DiscoveryRow
from pipelines.discovery.evidence_state import Alarm, hypothesis
from pipelines.discovery.figures_of_name import station_sizes
from pipelines.discovery.lot_source import AXES, OWN_TEMPCO
from schemas.units import MICRO

PROPORTIONAL = (
    "it is proportional to each unit's own temperature coefficient: the temperature readings are wrong in some soaks"
)


def station_row(known: Alarms, alarm: Alarm) -> DiscoveryRow:
    """The row of an error of the station, which changes the force for all units of a lot."""
    effect, column, _ = hypothesis(known.state, alarm.index)
    at = alarm.index - known.state.sensor.size
    station = known.state.station
    sizes = station_sizes(station, at)
    of_driver = [a for a in known.open_alarms if a.driver == alarm.driver]
    effects = [known.effect_of(a) for a in of_driver if a.index >= known.state.sensor.size]
    scale = float(station.noise[0][at])
    values = np.array([value for value, _ in sizes.values()])
    size, reach = float(np.sqrt(np.mean(values**2))), 2.0 * max(scale * error for _, error in sizes.values())
    return {
        "id": "",
        "since": known.day_of(alarm),
        "lots_then": alarm.lots,
        "effects": list(dict.fromkeys([effect, *effects])),
        "recommended": effect,
        "axes": [],
        "driver": alarm.driver,
        "drivers": [alarm.driver],
        "kind": "mean" if alarm.driver == MEAN else "slope" if alarm.driver == DATE else "levels",
        "size_ug": MICRO * size,
        "interval_ug": [MICRO * max(size - reach, 0.0), MICRO * (size + reach)],
        "size_floors": known.floors(size),
        "log_e": round(known.log_e(alarm), 2),
        "scope": "station",
        "because": f"the force is changed equally for all units of a lot (column {column + 1} of {effect})",
        "levels": [
            {"level": label, "size_ug": MICRO * value, "u_ug": MICRO * error * scale, "units": 0}
            for label, (value, error) in sizes.items()
        ],
        "carried_by": {"lots_for": None, "log_e_without_largest_2_percent": None},
        "confirmed": None,
        "next": "check the station's references (level, encoders, fixture), see 'tumbleline audit'",
    }


def thermometer_row(known: Alarms) -> DiscoveryRow:
    """The row of an error of the thermometer, which every unit shows by its temperature coefficient."""
    alarms, k = known.of_thermometer, len(known.state.columns)
    effect = known.effect_of(alarms[0])
    sums = known.state.sensor.levels[OWN_TEMPCO + INSIDE]
    slope, total = (sums.place[label] for label in (SLOPE, ALL))
    information = sums.information[slope]
    # rms over the units, of the coefficient and of its error by the scatter within lots
    spread = np.sqrt(over(information, sums.information[total])) * known.pool.size
    size = over(sums.score[slope], information) * spread
    error = np.where(information > 0.0, known.state.sensor.noise[1], 0.0) * over(spread, np.sqrt(information))
    indices = np.array([axis * k + known.pool.places(effect)[0] for axis in range(AXES)])
    rms, wide = (float(np.sqrt(np.mean(values[indices] ** 2))) for values in (size, error))
    sizes = np.abs(size[indices])
    return {
        "id": "",
        "since": known.day_of(min(alarms, key=lambda alarm: alarm.lots)),
        "lots_then": min(alarm.lots for alarm in alarms),
        "effects": list(dict.fromkeys(known.effect_of(alarm) for alarm in alarms)),
        "recommended": effect,
        "axes": [a for a, of_axis in zip("xyz", sizes, strict=True) if of_axis > 0.25 * sizes.max()],
        "driver": OWN_TEMPCO,
        "drivers": [OWN_TEMPCO],
        "kind": "slope",
        "size_ug": MICRO * rms,
        "interval_ug": [MICRO * max(rms - 2.0 * wide, 0.0), MICRO * (rms + 2.0 * wide)],
        "size_floors": known.floors(rms),
        "log_e": round(known.log_e(alarms[0]), 2),
        "scope": "thermometer",
        "because": PROPORTIONAL,
        "levels": [],
        "carried_by": {"lots_for": None, "log_e_without_largest_2_percent": None},
        "confirmed": None,
        "next": "compare the thermometer with a reference in every soak, and wait longer before the first dwell",
    }
