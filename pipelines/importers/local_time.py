"""Local times without a zone: points in time where the zone is stated; else the hour that a change of the clock skips is told."""

from contextlib import suppress
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.importers import values
from schemas.errors import DataRejected

CHECK_HOUR = "CHECK THE TIMES"
HOUR_S = 3600.0
CHANGING = (
    "Europe/Berlin",
    "Europe/London",
    "Europe/Athens",
    "America/New_York",
    "Australia/Sydney",
    "Pacific/Auckland",
)
"""A zone of each rule by which clocks are changed now."""


def local_seconds(local: pd.Series, zone: str, where: str) -> tuple[Array, tuple[str, ...]]:
    """Seconds (n,) since the first of local times, and a remark where their clock may have been changed between two rows.

    Parameters
    ----------
    local : (n,), without a zone
    zone : of the times; empty: not known

    Raises
    ------
    DataRejected
        A time does not exist in the zone; or without a zone the times go back by the hour of a change in autumn.
    """
    if zone:
        return values.seconds(_instants(local, zone, where), where), ()
    seconds = values.seconds(local, where)
    steps = np.diff(seconds)
    usual = float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
    for row in np.flatnonzero(np.abs(np.abs(steps - usual) - HOUR_S) <= min(0.5 * usual, 0.1 * HOUR_S)) + 1:
        before, after = (local.iloc[k].to_pydatetime(warn=False) for k in (row - 1, row))
        hours = 1 if after > before else -1
        likely = next((name for name in CHANGING if _change(name, before, after) == timedelta(hours=hours)), "")
        if not likely:
            continue
        season, direction = ("spring", "forward") if hours > 0 else ("autumn", "back")
        found = f"the times jump {direction} by an hour before row {row + 1} ({before} to {after}), as local ones do in {season}"
        remedy = f"if they are local, import again with --set zone=NAME, for instance {likely}"
        if hours < 0:
            raise DataRejected(f"{where}: {found}; {remedy}")
        return seconds, (f"{CHECK_HOUR}: {found}; {remedy}",)
    return seconds, ()


def _change(zone: str, before: datetime, after: datetime) -> timedelta:
    """By how much a clock of a zone is put forward between two of its times; nothing where the zone is not known here."""
    with suppress(ZoneInfoNotFoundError):
        known = ZoneInfo(zone)
        early, late = before.replace(tzinfo=known), after.replace(tzinfo=known, fold=1)
        return (late.utcoffset() or timedelta()) - (early.utcoffset() or timedelta())
    return timedelta()


def _instants(local: pd.Series, zone: str, where: str) -> pd.Series:
    """The points in time; of an hour that is there twice, the second one after a step back."""
    first, second = (
        local.dt.tz_localize(zone, ambiguous=np.full(len(local), dst), nonexistent="NaT") for dst in (True, False)
    )
    missing = np.flatnonzero(first.isna() & local.notna())
    if missing.size:
        row = int(missing[0])
        raise DataRejected(
            f"{where}: row {row + 1}: {local.iloc[row]} does not exist in {zone}, whose clocks skip it; correct --set zone, or "
            "leave it out where the times are not local"
        )
    early, late = (instants.dt.tz_convert("UTC").to_numpy("datetime64[ns]") for instants in (first, second))
    chosen = early.copy()
    for row in np.flatnonzero(early != late):
        if row and chosen[row] < chosen[row - 1]:
            chosen[row] = late[row]
    return pd.Series(chosen, name=local.name)
