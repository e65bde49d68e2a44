"""Whether the archive comes out the same again: every stage worked out anew from its stored inputs, byte against byte."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from pipelines.archive import Archive, Run, files, parquet
from pipelines.archive.keys import libraries
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.rerun import raw_samples
from pipelines.rerun.steps import RAW, plan_of
from schemas import tables
from schemas.errors import DataRejected

if TYPE_CHECKING:
    from pipelines.rerun.steps import StageCall

SAME, OTHER, LEFT_OUT = "same bytes", "other bytes", "not checked"


@dataclass(frozen=True)
class Reproduction:
    """What a check of one run found.

    tables : by name, whether its bytes came out again
    differences : what differs and by how much, one sentence per table
    changed : what is not as it was when the run was made: code of stages, versions of libraries
    """

    run: str
    tables: dict[str, str] = field(default_factory=dict)
    differences: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    error: str = ""

    @property
    def same(self) -> bool:
        """Whether every table that could be checked came out again."""
        return not self.error and not self.differences


def check(archive: Archive, run_id: str) -> Reproduction:
    """Every stage of a run worked out anew from the inputs that are stored, compared byte for byte; nothing is written.

    A stage whose inputs are stored and whose outputs come out again proves itself; all stages together prove the run from
    the raw samples on.
    """
    run = Run(archive, run_id)
    plan, raw = plan_of(run, ModelChange()), raw_samples(run)
    there = set(run.tables())
    found = Reproduction(run_id)
    with threadpool_limits(1):
        for step in plan.steps:
            if step.name == "import" or not there.issuperset(step.outputs):
                continue
            if not raw and (step.name in {"capture", *RAW[:2]} or (step.name == "noise" and _static(run))):
                found.tables.update(dict.fromkeys(step.outputs, LEFT_OUT))
                continue
            _changed(run, step, found.changed)
            _compare(run, step, found)
    if not set(found.tables.values()) - {LEFT_OUT}:
        raise DataRejected(
            f"run {run_id}: none of its tables can be worked out anew, one at least is needed; run it again first"
        )
    return found


def _static(run: Run) -> bool:
    return bool((run.table("readings")["kind"] == "allan").any())


def _compare(run: Run, step: StageCall, found: Reproduction) -> None:
    for name, frame in step.call(run).items():
        made = parquet.table_bytes(name, tables.check(name, frame, where=f"{step.name} → {name}"), tables.VERSION)
        stored = run.manifest(name)["sha256"]
        same = files.hash_of(made) == stored
        found.tables[name] = SAME if same else OTHER
        if not same:
            found.differences.append(f"{name}: {_difference(run.table(name), frame)}")


def _changed(run: Run, step: StageCall, changed: list[str]) -> None:
    """What is not as it was when the stage was run, each said once."""
    manifest = run.manifest(step.outputs[0])
    if manifest.get("code", "") != step.code:
        changed.append(f"code of {step.name}")
    before, now = manifest.get("libraries", {}), libraries()
    said = [f"{name} {before.get(name, '?')} → {now[name]}" for name in now if before.get(name) != now[name]]
    changed += [one for one in said if one not in changed]


def _difference(before: pd.DataFrame, after: pd.DataFrame) -> str:
    """In words, how two tables differ."""
    if list(before.columns) != list(after.columns):
        other = sorted(set(before.columns) ^ set(after.columns))
        return f"other columns ({', '.join(other) or 'in another order'})"
    if len(before) != len(after):
        return f"{len(before)} rows were stored, {len(after)} come out"
    said = [_of_column(name, before[name], after[name].reset_index(drop=True)) for name in before.columns]
    return (
        "; ".join(one for one in said if one)
        or "the same values in other bytes (another version of the Parquet writer)"
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
