"""Coefficients of many units: two populations where one is expected."""

from __future__ import annotations

import numpy as np

from inertial.discovery.populations import two_populations
from pipelines.archive import Archive
from pipelines.audit.calibrations import dated_runs, first_runs, load
from pipelines.audit.index import up_to_date
from pipelines.audit.parameters import FAMILIES, FAMILY_OF, NAMES, unit_text
from pipelines.discovery.documents import PopulationRow
from pipelines.discovery.evidence_state import ALPHA

_SEED = 20


def populations(archive: Archive, device: str, workers: int = 1) -> list[PopulationRow]:
    """Coefficients whose units are two populations: each unit once, by its first calibration."""
    index = up_to_date(archive, workers=workers)
    every = load(index, first_runs(dated_runs(index), np.inf))
    own = every.chosen(every.device.astype(str) == device)
    order = np.argsort(own.day, kind="stable")
    first = own.chosen(order[np.unique(own.unit[order].astype(str), return_index=True)[1]])
    judged = [name for name in NAMES if FAMILIES[FAMILY_OF[name]].own]
    needed = float(np.log(len(judged) / ALPHA))
    rows: list[PopulationRow] = []
    for name in judged:
        found = two_populations(first.column(name), np.random.default_rng(_SEED))
        if found is None or found.log_e < needed:
            continue
        rows.append(
            {
                "figure": name,
                "kind": "two_populations",
                "log_e": round(found.log_e, 2),
                "detail": {
                    "means": list(found.means),
                    "widths": list(found.widths),
                    "share": found.share,
                    "unit": unit_text(name),
                    "units": len(first),
                },
            }
        )
    return rows
