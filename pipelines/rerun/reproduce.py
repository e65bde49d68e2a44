"""Reproduction of archived runs: every stage is computed again from its stored inputs and compared byte by byte."""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from pipelines.archive import Archive, Run, files, parquet
from pipelines.archive.keys import libraries
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.rerun import has_static_record, raw_samples
from pipelines.rerun.steps import FROM_SAMPLES, StageCall, plan_of
from schemas import table_check, tables
from schemas.errors import DataRejected

SAME, OTHER, LEFT_OUT = "same bytes", "other bytes", "not checked"


@dataclass(frozen=True)
class Reproduction:
    """Whether the tables of one run are reproduced; ``same`` where every table is that could be checked."""

    run: str
    tables: Annotated[dict[str, str], "`same bytes`, `other bytes` or `not checked` by table"] = field(
        default_factory=dict
    )
    differences: Annotated[list[str], "what differs and by how much, one sentence per table"] = field(
        default_factory=list
    )
    changed: Annotated[list[str], "code and libraries that changed since the run"] = field(default_factory=list)
    error: str = ""
    same: bool = False


def check(archive: Archive, run_id: str) -> Reproduction:
    """Compute every stage of a run again from its stored inputs and compare byte by byte; nothing is written.

    Each stage is checked on its own inputs; all stages together check the run from the raw samples on.
    """
    run = Run(archive, run_id)
    plan, raw = plan_of(run, ModelChange()), raw_samples(run)
    there = set(run.tables())
    result = Reproduction(run_id)
    with threadpool_limits(1):
        for step in plan.steps:
            if step.name == "import" or not there.issuperset(step.outputs):
                continue
            if not raw and (
                step.name in {"capture", *FROM_SAMPLES} or (step.name == "noise" and has_static_record(run))
            ):
                result.tables.update(dict.fromkeys(step.outputs, LEFT_OUT))
                continue
            _changed(run, step, result.changed)
            _compare(run, step, result)
    if not set(result.tables.values()) - {LEFT_OUT}:
        raise DataRejected(
            f"run {run_id}: none of its tables can be computed again, at least one is needed; re-run it first"
        )
    return replace(result, same=not result.differences)


def _compare(run: Run, step: StageCall, result: Reproduction) -> None:
    for name, frame in step.call(run).items():
        made = parquet.table_bytes(name, table_check.check(name, frame, where=f"{step.name} → {name}"), tables.VERSION)
        stored = run.manifest(name)["sha256"]
        same = files.hash_of(made) == stored
        result.tables[name] = SAME if same else OTHER
        if not same:
            result.differences.append(f"{name}: {_difference(run.table(name), frame)}")


def _changed(run: Run, step: StageCall, changed: list[str]) -> None:
    """Changes since the stage was run, each listed once."""
    manifest = run.manifest(step.outputs[0])
    if manifest.get("code", "") != step.code:
        changed.append(f"code of {step.name}")
    before, now = manifest.get("libraries", {}), libraries()
    texts = [f"{name} {before.get(name, '?')} → {now[name]}" for name in now if before.get(name) != now[name]]
    changed += [text for text in texts if text not in changed]


def _difference(before: pd.DataFrame, after: pd.DataFrame) -> str:
    if list(before.columns) != list(after.columns):
        other = sorted(set(before.columns) ^ set(after.columns))
        return f"other columns ({', '.join(other) or 'in another order'})"
    if len(before) != len(after):
        return f"{len(before)} rows are stored, {len(after)} are computed"
    texts = [_of_column(name, before[name], after[name].reset_index(drop=True)) for name in before.columns]
    return (
        "; ".join(filter(None, texts)) or "the same values in different bytes (another version of the Parquet writer)"
    )


def _of_column(name: str, before: pd.Series, after: pd.Series) -> str:
    if pd.api.types.is_numeric_dtype(before) and pd.api.types.is_numeric_dtype(after):
        a, b = before.to_numpy(dtype=float), after.to_numpy(dtype=float)
        other = ~((a == b) | (np.isnan(a) & np.isnan(b)))
        if not other.any():
            return ""
        size = np.abs(b - a)[other]
        with np.errstate(over="ignore"):  # infinite where the value was zero
            relative = size / np.maximum(np.abs(a[other]), np.finfo(float).tiny)
        return f"{name} in {int(other.sum())} of {len(a)} rows, by at most {size.max():.2g} ({relative.max():.1g} relative)"
    other = before.astype(str).to_numpy() != after.astype(str).to_numpy()
    return f"{name} in {int(other.sum())} of {len(before)} rows" if other.any() else ""
