"""What the table ``prior`` of a run says: how much earlier calibrations count, and where they do not."""

from collections.abc import Mapping
from typing import Annotated, Any

import pandas as pd
from typing_extensions import TypedDict

from pipelines.tables.frames import rows_of


class PriorDocument(TypedDict):
    """The prior of a lot, or of one of its units."""

    units: Annotated[int, "earlier units of the family"]
    shares: Annotated[dict[str, float], "largest share of the prior in the variance by noise, by effect"]
    widened: Annotated[
        dict[str, float], "factor of its standard deviation where the lot differs from the family, by effect"
    ]
    own: Annotated[list[str], "units whose own earlier calibrations count"]
    groups: Annotated[dict[str, str], "units that lean on earlier ones with the same attribute, with its value"]
    foreign: Annotated[
        dict[str, float], "units that do not fit the family and have no prior, with the probability of that"
    ]


def prior_document(table: pd.DataFrame, about: Mapping[str, Any]) -> PriorDocument | None:
    """The prior of the rows of a table of a run, and what the run is about; None where there are none."""
    if table.empty:
        return None
    document: PriorDocument = {
        "units": int(table["units"].iloc[0]),
        "shares": {},
        "widened": {},
        "own": [],
        "groups": {},
        "foreign": {},
    }
    shares, groups = document["shares"], (about.get("prior") or {}).get("groups", {})
    for row in rows_of(table):
        effect, unit = str(row["effect"]), str(row["unit"])
        shares[effect] = max(shares.get(effect, 0.0), float(row["share"]))
        if row["widened"] > 1.0:
            document["widened"][effect] = float(row["widened"])
        if unit in groups:
            document["groups"][unit] = groups[unit]
        elif row["own"] and unit not in document["own"]:
            document["own"].append(unit)
        if not row["fits"]:
            document["foreign"][unit] = float(row["p_value"])
    return document


LEAST_TOLD = 0.01  # share of a prior in a variance


def prior_sentence(prior: PriorDocument) -> str:
    """A prior in words, for summary and certificate."""
    told = [f"{100.0 * v:.0f} % of the variance of {name}" for name, v in prior["shares"].items() if v >= LEAST_TOLD]
    parts = [f"prior of {prior['units']} units: {', '.join(told) or 'below 1 % of every variance'}"]
    if prior["own"]:
        parts.append(f"own earlier calibrations of {', '.join(prior['own'])} count")
    for group in dict.fromkeys(prior["groups"].values()):
        units = [unit for unit, family in prior["groups"].items() if family == group]
        parts.append(f"earlier units of {group} count for {', '.join(units)}")
    if prior["widened"]:
        wide = ", ".join(f"{name} {factor:.1f} times" for name, factor in prior["widened"].items())
        parts.append(f"the lot differs from its family, the prior is widened: {wide}")
    parts += [f"{unit} does not fit its family (p = {p:.1e}) and has no prior" for unit, p in prior["foreign"].items()]
    return "; ".join(parts)
