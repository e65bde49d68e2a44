"""The tables of a day in the exchange format."""

from __future__ import annotations

import numpy as np
import pandas as pd

from benchmarks.strangers.devices import Devices
from benchmarks.strangers.kinds import Record
from benchmarks.strangers.station import STEP_S, Day, Floats, force_of

AXES = "xyz"
HISTORY_S = 60.0


def dwell_table(day: Day, devices: Devices, record: Record, sd: Floats) -> pd.DataFrame:
    """One row per unit and dwell; sd (d, u, 3) is the standard deviation of a sample, g."""
    dwells, units = record.time_s.shape
    plan, out, scatter = day.plan, record.out, sd * devices.scale
    force = force_of(record.angles[..., 0], record.angles[..., 1])
    alike = {
        "chamber_C": np.round(day.mean(day.chamber), 3),
        "since_move_s": np.round(day.since_move, 2),
        "since_power_s": np.round(day.mean(day.t), 1),
        "supply_V": np.round(day.mean(day.supply), 5),
    }
    if plan.weather:
        alike |= {"room_C": np.round(day.mean(day.room), 2), "pressure_hPa": np.round(day.mean(day.pressure), 2)}
    pages = []
    for unit in range(units):
        columns: dict[str, object] = {
            "unit": devices.serials[unit],
            "slot": unit,
            "dwell": np.arange(1, dwells + 1),
            "time_s": np.round(record.time_s[:, unit], 1),
            "duration_s": plan.duration_s,
            "n": round(plan.duration_s * devices.rate_hz),
        }
        if plan.columns != "force":
            columns |= {
                name: np.round(np.rad2deg(record.angles[:, unit, i]), 7)
                for i, name in enumerate(["outer_deg", "inner_deg"])
            }
        if plan.columns != "angles":
            columns |= {f"force_{axis}": np.round(force[:, unit, i], 9) for i, axis in enumerate(AXES)}
        columns |= {f"out_{axis}": out[:, unit, i] for i, axis in enumerate(AXES)}
        columns |= {f"sd_{axis}": scatter[:, unit, i] for i, axis in enumerate(AXES)}
        columns |= {"out_unit": devices.out_unit, "unit_C": np.round(record.temperature[:, unit], 4), **alike}
        pages.append(pd.DataFrame(columns))
    return pd.concat(pages, ignore_index=True)


def history_table(day: Day, devices: Devices, record: Record) -> pd.DataFrame:
    """Temperatures of air and units against time, once a minute from the start of the day."""
    rows = slice(None, None, round(HISTORY_S / STEP_S))
    pages = [
        pd.DataFrame(
            {
                "time_s": day.t[rows],
                "chamber_C": np.round(day.chamber[rows], 3),
                "slot": unit,
                "unit": serial,
                "unit_C": np.round(record.log[rows, unit], 3),
            }
        )
        for unit, serial in enumerate(devices.serials)
    ]
    return pd.concat(pages, ignore_index=True)
