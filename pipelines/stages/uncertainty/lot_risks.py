"""Risk of the decisions on a lot: false acceptance and false rejection over the production that it represents (JCGM 106, 9)."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from inertial.uncertainty.risk import lot_risk, process_deviation
from pipelines.tables.frames import empty_table
from schemas.limits import Limits

TEXTS, NUMBERS = "figure unit_text", "mean process u limit accept pfa pfr accepted largest_pfa"
FEWEST = 3
"""Units from which the scatter of a production is estimated."""


def lot_risks(figures: pd.DataFrame, limits: Limits, shared: Mapping[str, float]) -> pd.DataFrame:
    """One row per figure with a limit: mean, process standard deviation, uncertainty, PFA and PFR.

    σ_p² = s² − u², with the part of u that differs between units; the part common to the lot, that of the references, is not in
    s, and moves all units alike. nan where fewer than three units were judged. ``largest_pfa`` is the largest specific
    probability of a unit that was accepted.

    Parameters
    ----------
    shared : standard uncertainty that the units of the lot have in common, by figure
    """
    rows: list[dict[str, Any]] = []
    numbers = {name: figures[name].to_numpy(dtype=float) for name in ("value", "uncertainty", "limit", "accept", "pfa")}
    names, texts = (figures[name].to_numpy(dtype=object) for name in ("figure", "unit_text"))
    limited = np.flatnonzero(np.isfinite(numbers["limit"]))
    for name in dict.fromkeys(names[limited].tolist()):
        places = limited[names[limited] == name]
        columns = {column: values[places] for column, values in numbers.items()}
        values = columns["value"]
        u = float(np.sqrt(np.mean((columns["uncertainty"] / limits.coverage_factor) ** 2)))
        limit, accept = float(columns["limit"][0]), float(np.nanmean(columns["accept"]))
        common = min(shared.get(str(name), 0.0), u)
        own_u = float(np.sqrt(u**2 - common**2))
        process = process_deviation(values.tolist(), own_u)
        rows.append(
            {
                "figure": name,
                "unit_text": texts[places[0]],
                "units": len(values),
                "mean": float(values.mean()),
                "process": process,
                "u": u,
                "limit": limit,
                "accept": accept,
                **_risks(float(values.mean()), process, (own_u, common), limit, accept, len(values)),
                "largest_pfa": float(np.fmax.reduce(columns["pfa"])),
            }
        )
    return pd.DataFrame(rows) if rows else empty_table(texts=TEXTS, integers="units", numbers=NUMBERS)


def _risks(
    mean: float, process: float, parts: tuple[float, float], limit: float, accept: float, units: int
) -> dict[str, float]:
    if units < FEWEST or not np.isfinite(process) or not accept > 0.0:
        return {"pfa": float("nan"), "pfr": float("nan"), "accepted": float("nan")}
    risk = lot_risk(mean, process, *parts, (-limit, limit), (-accept, accept))
    return {"pfa": risk.pfa, "pfr": risk.pfr, "accepted": risk.accepted}
