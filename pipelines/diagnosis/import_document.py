"""One import as a document: the recording is read, judged and stored."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pandas as pd

from pipelines.importers.content import Content
from pipelines.importers.exchange import checked, is_exchange, read_history
from pipelines.importers.files import SourceFile
from pipelines.importers.mapping import Mapping
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.import_references import ImportReferences


def import_document(
    paths: list[Path],
    keys: dict[str, Any],
    where: str,
    fit: str,
    archive: str | None,
    stated: ImportReferences | None,
    working: Callable[[str], AbstractContextManager[Any]],
) -> dict[str, Any]:
    """Read, judge and store one recording; returns the document for JSON.

    Parameters
    ----------
    keys : keys of the mapping; where : their source, for messages
    fit : name of a fit; empty: none
    working : context manager that shows a text while its block runs
    """
    from pipelines.diagnosis.inputs import file_beside
    from pipelines.importers import keep, record, sources
    from pipelines.importers import mapping as mapped
    from pipelines.importers.dwell_list import dwell_rows
    from pipelines.importers.pose_check import CHECK_AXIS

    name = " + ".join(path.name for path in paths)
    columns, units = keys.get("columns"), keys.get("units")
    if isinstance(columns, dict) and isinstance(units, dict) and "output" in units:
        mapped.build(keys, where)  # reports an error of the mapping before any file is read
    with working(f"reading {name}"):
        time = str(columns.get("time", "")) if isinstance(columns, dict) else ""
        content, source, breaks = sources.read(
            paths, join=str(keys.get("join", "")), time=time, group=str(keys.get("group", ""))
        )
        exchange, unread = "columns" not in keys and is_exchange(content.table.columns), ()
        more = stated is not None or fit or keys.keys() - {"units", "device"}
        if exchange and more:
            keys, unread = mapped.of_exchange(content.table, keys)
            if beside := file_beside(str(paths[0]), "history"):
                unread += (f"temperatures that are not read with --references, --fit or --set: {Path(beside).name}",)
        elif exchange:
            return _table_of_dwells(content.table, keys, paths[0], source, archive)
        how = _mapping(keys, content, where, name)
        data = record.imported(content.table, how, name, content, breaks)
    judged = None
    if fit:
        from pipelines.diagnosis.imported_norms import judge

        with working("fitting and judging"):
            judged = judge(fit, data, how)
    run = keep.keep(data, source, how, judged, archive, stated)
    turned = fit == "plane" and judged is not None and judged.adequate is not False  # one axis is still on purpose
    slips = (  # covariates whose name is close to a known one
        f"'{shown(name)}' is imported as a covariate; if you mean {' or '.join(close)}, import again with that name"
        for name, close in how.likely_slips.items()
    )
    return {
        "run": run.id,
        "source": source.as_dict(),
        "units": data.units,
        "device": how.device or None,
        "out_unit": data.out_unit,
        "samples": 0 if data.samples is None else len(data.samples),
        "dwells": 0 if data.dwells is None else len(data.dwells),
        "remarks": [*(r for r in data.remarks if not (turned and r.startswith(CHECK_AXIS))), *slips, *unread],
        "faults": list(data.faults),
        "fit": fit or None,
        "adequate": None if judged is None else judged.adequate,
        **({} if judged is None else judged.document),
        "lines": [] if judged is None else list(judged.lines),
        "dwell_list": dwell_rows(data, judged, how),
    }


def _table_of_dwells(
    table: pd.DataFrame, keys: dict[str, Any], path: Path, source: SourceFile, archive: str | None
) -> dict[str, Any]:
    """Import a table of dwells in the exchange format, whose column names replace a mapping; returns the document."""
    from pipelines.diagnosis.inputs import file_beside
    from pipelines.importers.keep import complete_table, keep_table_of_dwells

    beside, device = file_beside(str(path), "history"), str(keys.get("device", ""))
    dwells, remarks = complete_table(
        checked(table, where=path.name, foreign=True), keys.get("units", {}).get("output", "")
    )
    run = keep_table_of_dwells(dwells, read_history(beside) if beside else None, path.name, archive, source, device)
    return {
        "run": run.id,
        "source": source.as_dict(),
        "units": list(dict.fromkeys(dwells["unit"].astype(str))),
        "device": device or None,
        "out_unit": str(dwells["out_unit"].iloc[0]) if "out_unit" in dwells.columns else "",
        "samples": 0,
        "dwells": len(dwells),
        "remarks": [*remarks, *([f"temperatures between the dwells: {Path(beside).name}"] if beside else [])],
        "faults": [],
        "fit": None,
        "adequate": None,
        "lines": [],
        "dwell_list": [],
    }


def _mapping(keys: dict[str, Any], content: Content, where: str, name: str) -> Mapping:
    """The mapping, completed by the unit that the file states; a mapping without columns or unit is refused."""
    from pipelines.importers import mapping as mapped
    from pipelines.importers import stated_units

    if "columns" not in keys:
        raise WrongUse(
            f"import: no column of {name} is mapped, x, y and z are needed at least (its columns: "
            f"{', '.join(map(str, content.table.columns))}); add --map time=…,x=…,y=…,z=… and --unit-of output=…, or --set "
            f"FILE.toml; 'tumbleline inspect {name}' proposes a command"
        )
    complete = stated_units.completed(keys, content)
    if "output" not in complete.get("units", {}) and all(axis in keys["columns"] for axis in mapped.NEEDED):
        raise WrongUse(
            f"import: the unit of the output is not given and {name} states none, one of {', '.join(mapped.OUTPUT_UNITS)} is "
            f"needed; add --unit-of output=…; 'tumbleline inspect {name}' shows the size of the numbers"
        )
    how = mapped.build(complete, where)
    stated_units.refuse_contradiction(how, content, name)
    return how
