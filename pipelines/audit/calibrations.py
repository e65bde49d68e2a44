"""All calibrations of an archive as arrays: unit, station, day and parameters."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial.arrays import Array, Flags, Index, Texts
from pipelines.audit.index import AuditIndex
from pipelines.audit.parameters import FAMILY_OF, NAMES

DAY_S = 86400.0
CLOCK_SET_D = 366.0  # a clock that was never set shows 1970
IMPORTED = "IMPORTED"
"""Kind of device of imported units that state none."""
DATE = "a date such as 2026-05-01T09:30:00Z is needed"


@dataclass(frozen=True)
class Calibrations:
    """Calibrations in order of unit, device, day and run; n of them.

    day : (n,), days since 1970, UTC; values, errors : (n, p), in the units of the parameters, NaN where the model has none
    """

    run: Texts
    unit: Texts
    device: Texts
    station: Texts
    slot: Index
    outcome: Texts
    day: Array
    values: Array
    errors: Array

    def __len__(self) -> int:
        return self.day.size

    def chosen(self, which: Flags | Index) -> "Calibrations":
        """The chosen calibrations, in their order."""
        return Calibrations(*(getattr(self, name)[which] for name in self.__dataclass_fields__))

    def column(self, name: str) -> Array:
        """Values of one parameter, (n,)."""
        return self.values[:, NAMES.index(name)]

    def error(self, name: str) -> Array:
        """Standard errors of one parameter, (n,)."""
        return self.errors[:, NAMES.index(name)]

    @property
    def histories(self) -> Index:
        """Number of the unit of every calibration, from 0; the same serial on two kinds of device is two units."""
        pair = (self.unit[1:] != self.unit[:-1]) | (self.device[1:] != self.device[:-1])
        return np.concatenate([[0], np.cumsum(pair)]) if len(self) else np.zeros(0, dtype=np.int64)


def codes(texts: NDArray[Any]) -> Index:
    """Texts as numbers from 0, in their alphabetical order."""
    return np.unique(texts.astype(str), return_inverse=True)[1].astype(np.int64)


def day_of(moment: str) -> float:
    """Days since 1970 of an ISO time; without a zone it is UTC."""
    instant = datetime.fromisoformat(moment)
    return (instant if instant.tzinfo else instant.replace(tzinfo=UTC)).timestamp() / DAY_S


def date_of(day: float) -> str:
    """The date of a day, ISO, UTC."""
    return (datetime(1970, 1, 1, tzinfo=UTC) + timedelta(days=float(day))).date().isoformat()


def dated_runs(index: AuditIndex) -> pd.DataFrame:
    """All runs, their columns as texts, with the day of measurement; NaN for a run without a plausible date."""
    runs = index.table("runs").to_pandas().astype(str)
    return runs.assign(day=[_day_or_nan(moment) for moment in runs["measured"]])


def first_runs(index: AuditIndex, runs: pd.DataFrame, until: float) -> pd.DataFrame:
    """Runs that were measured before ``until``, with their day, device and station; each capture once, by its first run.

    An import has no capture and becomes a calibration by a fit with limits: it counts by the last of these.
    """
    graded = set(index.table("units")["run"].to_pylist())
    imports = runs.loc[(runs["rerun_of"] == "") & (runs["capture"] == ""), "run"]
    fits = runs[runs["rerun_of"].isin(imports) & runs["run"].isin(graded)].sort_values("started", kind="stable")
    fits = fits.drop_duplicates("rerun_of", keep="last")
    runs = runs[(runs["rerun_of"] == "") & ~runs["run"].isin(fits["rerun_of"]) | runs["run"].isin(fits["run"])]
    runs = runs[runs["day"].notna()].sort_values(["day", "run"], kind="stable")
    capture = runs["capture"].where(runs["capture"] != "", runs["run"])
    return runs.loc[~capture.duplicated() & (runs["day"] < until), ["run", "day", "device", "station"]]


def left_out(runs: pd.DataFrame) -> list[tuple[str, str]]:
    """Runs that cannot be used, with the reason: first those with a fault of their files, then those whose date is none."""
    faulty, undated = runs[runs["problem"] != ""], runs[(runs["measured"] != "") & runs["day"].isna()]
    reasons = [
        f"its date {moment!r} is invalid, or from a clock that was never set; {DATE}" for moment in undated["measured"]
    ]
    return [*zip(faulty["run"], faulty["problem"], strict=True), *zip(undated["run"], reasons, strict=True)]


def _day_or_nan(moment: str) -> float:
    """Days since 1970; NaN for an invalid date, or a date from a clock that was never set."""
    try:
        day = day_of(moment)
    except ValueError:
        return float("nan")
    return day if day >= CLOCK_SET_D else float("nan")


def captures_of(runs: pd.DataFrame) -> dict[str, str]:
    """The capture of every run that has one, by the run's name."""
    captured = runs[runs["capture"] != ""]
    return dict(zip(captured["run"], captured["capture"], strict=True))


def load(index: AuditIndex, runs: pd.DataFrame) -> Calibrations:
    """The calibrations of some runs."""
    units, values = (index.table(name).to_pandas().astype({"run": str}) for name in ("units", "parameters"))
    frame = values.merge(runs, on="run").merge(units.astype({"unit": str}), on=["run", "unit"], how="left")
    frame = frame.sort_values(["unit", "device", "day", "run"], ignore_index=True, kind="stable")
    loaded = Calibrations(
        **{name: frame[name].astype(str).to_numpy(object) for name in ("run", "unit", "device", "station")},
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
            rows = loaded.device == device
            finite = np.isfinite(values[rows, column])
            if finite.any():
                nominal = float(np.median(values[rows, column][finite]))
                values[rows, column] = 1e6 * (values[rows, column] / nominal - 1.0)
                errors[rows, column] = 1e6 * errors[rows, column] / abs(nominal)
    return replace(loaded, values=values, errors=errors)
