"""All calibrations of an archive as arrays: unit, station, day and parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.audit.index import AuditIndex
from pipelines.audit.parameters import FAMILY_OF, NAMES

Array = NDArray[np.float64]
Texts = NDArray[np.object_]
Flags = NDArray[np.bool_]


DAY_S = 86400.0
CLOCK_SET_D = 366.0  # a clock that was never set shows 1970


@dataclass(frozen=True)
class Calibrations:
    """Calibrations in order of unit, device, day and run; n of them.

    day : (n,), days since 1970, UTC; values, errors : (n, p), in the units of the parameters, NaN where the model has none
    """

    run: Texts
    unit: Texts
    device: Texts
    station: Texts
    slot: NDArray[np.int64]
    outcome: Texts
    day: Array
    values: Array
    errors: Array

    def __len__(self) -> int:
        return self.day.size

    def chosen(self, which: Flags | NDArray[np.int64]) -> Calibrations:
        """The chosen calibrations, in their order."""
        return Calibrations(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def column(self, name: str) -> Array:
        """Values of one parameter, (n,)."""
        return self.values[:, NAMES.index(name)]

    def error(self, name: str) -> Array:
        """Standard errors of one parameter, (n,)."""
        return self.errors[:, NAMES.index(name)]

    def numbers(self, of: Callable[[Calibrations], Texts]) -> NDArray[np.int64]:
        """A column of texts as numbers from 0."""
        return codes(of(self))

    @property
    def histories(self) -> NDArray[np.int64]:
        """Number of the unit of every calibration, from 0; the same serial on two kinds of device is two units."""
        pair = (self.unit[1:] != self.unit[:-1]) | (self.device[1:] != self.device[:-1])
        return np.concatenate([[0], np.cumsum(pair)]) if len(self) else np.zeros(0, dtype=np.int64)


def codes(texts: NDArray[Any]) -> NDArray[np.int64]:
    """Texts as numbers from 0, in their alphabetical order."""
    return np.unique(texts.astype(str), return_inverse=True)[1].astype(np.int64)


def day_of(moment: str) -> float:
    """Days since 1970 of an ISO time; one without zone is UTC."""
    instant = datetime.fromisoformat(moment)
    return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp() / DAY_S


def date_of(day: float) -> str:
    """The date of a day, ISO, UTC."""
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=float(day))).date().isoformat()


def runs_of(index: AuditIndex, until: float) -> pd.DataFrame:
    """Runs that were measured before ``until``, with their day, device and station; each capture once.

    Of each capture only the first run counts, not its re-runs.
    """
    runs = index.table("runs").to_pandas()
    runs = runs[(runs["rerun_of"].astype(str) == "") & (runs["measured"].astype(str) != "")].astype({"run": str})
    runs = runs.assign(day=[_day_or_nan(str(moment)) for moment in runs["measured"]])
    runs = runs[runs["day"].notna()].sort_values(["day", "run"], kind="stable")
    own = runs["capture"].astype(str).where(runs["capture"].astype(str) != "", runs["run"])
    chosen = runs[~own.duplicated() & (runs["day"] < until)]
    return chosen[["run", "day", "device", "station"]].astype({"device": str, "station": str})


def undated(index: AuditIndex) -> list[tuple[str, str]]:
    """Runs whose date cannot be read, with the fault of each."""
    runs = index.table("runs", ["run", "measured"]).to_pydict()
    return [
        (
            run,
            f"its date {moment!r} is invalid, or from a clock that was never set; a date such as 2026-05-01T09:30:00Z is needed",
        )
        for run, moment in zip(runs["run"], runs["measured"], strict=True)
        if moment and np.isnan(_day_or_nan(moment))
    ]


def later(index: AuditIndex, day: float) -> list[tuple[str, float]]:
    """Runs with a date of measurement on a day or after it, with their days."""
    runs = index.table("runs", ["run", "measured"]).to_pydict()
    dated = ((run, _day_or_nan(moment)) for run, moment in zip(runs["run"], runs["measured"], strict=True) if moment)
    return sorted((one for one in dated if one[1] >= day), key=lambda one: (one[1], one[0]))


def _day_or_nan(moment: str) -> float:
    """Days since 1970; NaN for an invalid date, or a date from a clock that was never set."""
    try:
        day = day_of(moment)
    except ValueError:
        return float("nan")
    return day if day >= CLOCK_SET_D else float("nan")


def captures_of(index: AuditIndex) -> dict[str, str]:
    """The capture of every run that has one, by the run's name."""
    runs = index.table("runs", ["run", "capture"]).to_pydict()
    return {run: capture for run, capture in zip(runs["run"], runs["capture"], strict=True) if capture}


def load(index: AuditIndex, runs: pd.DataFrame) -> Calibrations:
    """The calibrations of some runs."""
    units = index.table("units").to_pandas()
    values = index.table("parameters").to_pandas()
    for frame in (units, values):
        frame["run"] = frame["run"].astype(str)
    frame = values.merge(runs, on="run").merge(units.astype({"unit": str}), on=["run", "unit"], how="left")
    frame = frame.sort_values(["unit", "device", "day", "run"], ignore_index=True, kind="stable")
    loaded = Calibrations(
        run=frame["run"].to_numpy(object),
        unit=frame["unit"].astype(str).to_numpy(object),
        device=frame["device"].astype(str).to_numpy(object),
        station=frame["station"].astype(str).to_numpy(object),
        slot=frame["slot"].fillna(-1).to_numpy(np.int64),
        outcome=frame["outcome"].astype(object).fillna("").to_numpy(object),
        day=frame["day"].to_numpy(float),
        values=frame[list(NAMES)].to_numpy(float),
        errors=frame[[f"{name}_error" for name in NAMES]].to_numpy(float),
    )
    return _scale_in_ppm(loaded)


def _scale_in_ppm(loaded: Calibrations) -> Calibrations:
    """The scale factors as deviations from the median of their kind and axis, ppm."""
    values, errors = np.array(loaded.values), np.array(loaded.errors)
    for column in (k for k, name in enumerate(NAMES) if FAMILY_OF[name] == "scale"):
        for device in np.unique(loaded.device.astype(str)):
            own = loaded.device == device
            finite = np.isfinite(values[own, column])
            if finite.any():
                nominal = float(np.median(values[own, column][finite]))
                values[own, column] = 1e6 * (values[own, column] / nominal - 1.0)
                errors[own, column] = 1e6 * errors[own, column] / abs(nominal)
    return replace(loaded, values=values, errors=errors)
