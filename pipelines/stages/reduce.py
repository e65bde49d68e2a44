"""Samples to dwells: one row per accepted unit and static dwell, in the exchange format, with all recorded covariates."""

from typing import NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.frames import force_from_angles
from inertial.quantities import ANGLE_COLUMNS, BY_ATTRIBUTE, READINGS
from pipelines.tables.dwell_table import covariates
from pipelines.tables.summaries import MEANS, PROCEDURE, SPREADS, STATIC, there
from schemas.errors import DataRejected
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

KEPT = (
    *("unit", "slot", "record", "kind", "pose", "soak", "duration_s"),
    *ANGLE_COLUMNS,
    *READINGS,
    "out_unit",
)
WHERE_THERE = (BY_ATTRIBUTE["power_off"].column,)
"""Columns only of runs that switch their devices off and on."""


class FollowedSupply(NamedTuple):
    """Nominal supply, V, and the share of its relative change that the output follows."""

    nominal_V: float
    share: float

    def ratio(self, supply: Array) -> Array:
        """Output at measured supplies, V, over that at the nominal supply."""
        return 1.0 + self.share * (supply / self.nominal_V - 1.0)


def reduce(
    summaries: pd.DataFrame,
    readings: pd.DataFrame,
    verdicts: pd.DataFrame,
    local_gravity_m_s2: float,
    follows: FollowedSupply | None = None,
) -> pd.DataFrame:
    """Dwells of the accepted units, in order of measurement.

    Parameters
    ----------
    summaries : summaries of the samples, :func:`pipelines.tables.summaries.summarised`
    readings : readings of the complete run; the reference force comes from the encoder readings
    verdicts : verdicts of the validate stage
    local_gravity_m_s2 : gravity at the station; the force is stated in standard g
    follows : how the outputs follow the supply; if given, they are corrected to the nominal supply
    """
    accepted = set(verdicts.loc[~verdicts["refused"], "unit"])
    means = summaries.loc[
        summaries["unit"].isin(accepted), ["unit", "record", *there(summaries, (*MEANS, *SPREADS)), "n"]
    ]
    static = readings[readings["unit"].isin(accepted) & ~readings["kind"].isin([STATIC, PROCEDURE])]
    # a covariate with a missing reading cannot be used by a model; it stays in the readings
    recorded = [column for column in covariates(readings) if static[column].notna().all()]
    names = [*KEPT, *(c for c in WHERE_THERE if c in static.columns), *recorded]
    columns = static[[*names, "start_s"]].assign(time_s=static["start_s"] + 0.5 * static["duration_s"])
    dwells = columns.drop(columns="start_s").merge(means, on=["unit", "record"], validate="one_to_one")
    angles = (np.radians(dwells[name].to_numpy()) for name in ("outer_deg", "inner_deg"))
    force = local_gravity_m_s2 / STANDARD_GRAVITY_M_S2 * force_from_angles(*angles)
    dwells = dwells.assign(dwell=dwells["record"], **{f"force_{axis}": force[:, i] for i, axis in enumerate(AXES)})
    if follows is not None:
        dwells = at_nominal_supply(dwells, follows)
    return dwells.sort_values(["unit", "dwell"], ignore_index=True)


def at_nominal_supply(dwells: pd.DataFrame, follows: FollowedSupply) -> pd.DataFrame:
    """The dwells with outputs corrected to the nominal supply, by the supply measured in each dwell.

    The complete output follows the supply, including the level at 0 g: 1 ppm of supply moves a level of 1.5 V at 0.3 V/g by 5 µg.
    """
    column = BY_ATTRIBUTE["supply"].column
    supply = dwells[column].to_numpy(dtype=float)
    bad = np.flatnonzero(~(np.isfinite(supply) & (supply > 0.0)))
    if bad.size:
        row = dwells.iloc[int(bad[0])]
        raise DataRejected(
            f"reduce: unit {row['unit']}, dwell {row['dwell']}: supply {supply[bad[0]]:g} V, a measured supply is needed, for "
            f"the output follows it; check the meter of slot {row['slot']}, or take ratio_measured out of [uncertainty]"
        )
    ratio = follows.ratio(supply)
    return dwells.assign(
        **{name: dwells[name].to_numpy(dtype=float) / ratio for name in there(dwells, (*MEANS, *SPREADS))}
    )
