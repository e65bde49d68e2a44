"""The page: what the template needs, in words and rounded numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.capture.interruptions import interruptions
from pipelines.report.numbers import plain, with_uncertainty
from pipelines.report.plots import check_plots, lot_plot, model_plots
from pipelines.report.templates import template
from pipelines.stages.figures import FIGURES
from pipelines.tables.frames import rows_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from pipelines.archive import Run
    from pipelines.certificates.statement import Stated

COVERAGE = 2.0


def render(run: Run, certificates: Mapping[str, Stated] | None = None) -> str:
    """The report of a run as one HTML text that needs no other file.

    Parameters
    ----------
    certificates : of its units, as the ledger has them now
    """
    tables = {name: run.table(name) for name in ("verdicts", "dwells", "coefficients", "residuals", "verification")}
    tables |= {name: run.table(name) for name in ("verification_poses", "allan", "noise", "figures", "grades")}
    grades = tables["grades"].sort_values("slot")
    limit = _limit(run, "verification_norm_ug")
    known = certificates or {}
    units: list[dict[str, Any]] = [
        {**_unit(row, tables), "certificate": known.get(str(row["unit"]))} for row in rows_of(grades)
    ]
    calibrated = [unit["unit"] for unit in units if unit["outcome"] != "refused"]
    return template("page.html").render(
        run=run.id,
        about=run.about,
        recipe=run.about["recipe"],
        rule=str(grades["rule"].iloc[0]),
        units=units,
        passed=sum(unit["outcome"] == "pass" for unit in units),
        lot_svg=_lot_svg(tables, calibrated, limit),
        verification_poses=len({pose["name"] for pose in run.about["recipe"]["verification"]}),
        interruptions=interruptions(run),
        provenance=_provenance(run),
    )


def _lot_svg(tables: dict[str, pd.DataFrame], units: list[str], limit: float) -> str:
    if not len(tables["verification"]):
        return ""
    return lot_plot(tables["verification"], tables["verification_poses"], units, limit)


def _limit(run: Run, figure: str) -> float:
    return float(run.about["limits"]["figures"].get(figure, {}).get("max", np.nan))


def _unit(row: dict[str, Any], tables: dict[str, pd.DataFrame]) -> dict[str, Any]:
    """What the page says of one unit; a refused one has its reasons and nothing else."""
    unit = str(row["unit"])
    own = {name: table[table["unit"] == unit] for name, table in tables.items()}
    shown = {**row, "reasons": [part for part in str(row["reasons"]).split("; ") if part]}
    if row["outcome"] == "refused":
        return {**shown, "figures": [], "short": {}, "coefficients": [], "noise": [], "plots": []}
    fitted = own["dwells"][own["dwells"]["kind"] == "dwell"]
    return {
        **shown,
        "figures": [_figure(f) for f in rows_of(own["figures"])],
        "short": {f["figure"]: plain(f["value"]) for f in rows_of(own["figures"])},
        "coefficients": _coefficients(own["coefficients"]),
        "noise": _noise(own["noise"]),
        "plots": [
            model_plots(fitted, own["residuals"]),
            check_plots(own["residuals"], own["verification"], own["allan"]),
        ],
    }


def _figure(row: dict[str, Any]) -> dict[str, Any]:
    value, expanded = with_uncertainty(row["value"], row["uncertainty"])
    limited = bool(np.isfinite(row["limit"]))
    return {
        "title": FIGURES[row["figure"]].label if row["figure"] in FIGURES else row["figure"],
        "value": value,
        "uncertainty": expanded,
        "limit": plain(row["limit"]) if limited else "",
        "margin": plain(row["limit"] - abs(row["value"])) if limited else "",
        "unit": "" if row["unit_text"] == "1" else row["unit_text"],
        "outcome": row["outcome"] if limited else "",
    }


def _coefficients(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """One line per coefficient with its three axes side by side."""
    lines: dict[tuple[str, int], dict[str, Any]] = {}
    seen: dict[tuple[str, str], int] = {}
    for row in rows_of(rows):
        place = seen.get((row["effect"], row["axis"]), 0)
        seen[row["effect"], row["axis"]] = place + 1
        line = lines.setdefault(
            (row["effect"], place), {"effect": row["effect"], "unit": row["unit_text"], "cells": {}}
        )
        value, expanded = with_uncertainty(row["value"], COVERAGE * row["standard_error"])
        line["cells"][row["axis"]] = {"name": row["name"], "value": value, "uncertainty": expanded}
    return list(lines.values())


def _noise(rows: pd.DataFrame) -> list[dict[str, Any]]:
    names = {
        "N": "N, velocity random walk (two-sided, IEEE 952)",
        "n_d": "n_d = N·√2, noise density (one-sided, data sheets)",
        "B": "B, bias instability",
        "K": "K, rate random walk",
        "Q": "Q, quantisation",
        "R": "R, ramp",
    }
    lines = []
    for term, name in names.items():
        own = rows[rows["term"] == term]
        if own.empty:
            continue
        cells = {row["axis"]: _noise_cell(row) for row in rows_of(own)}
        lines.append({"name": name, "unit": own["unit_text"].iloc[0], "cells": cells})
    return lines


def _noise_cell(row: dict[str, Any]) -> str:
    if not row["identified"]:
        return f"≤ {plain(row['high'])}"
    return f"{plain(row['value'])} ({plain(row['low'])} … {plain(row['high'])})"


def _provenance(run: Run) -> list[tuple[str, str]]:
    about = run.about
    stages = {run.manifest(name)["stage"]: run.manifest(name)["code"][:12] for name in run.tables()}
    return [
        ("run", run.id),
        ("capture", str(about.get("capture"))),
        ("started", f"{about['when'][:19].replace('T', ' ')} UTC by {about['who']} on {about['where']}"),
        ("station", f"{about['station']['name']} ({about['station']['kind']})"),
        ("libraries", ", ".join(f"{name} {version}" for name, version in about["libraries"].items())),
        ("code", ", ".join(f"{stage} {code}" for stage, code in stages.items() if code)),
    ]
