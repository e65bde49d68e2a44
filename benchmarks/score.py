"""Scores of diagnoses against sealed truth, and the table of figures.

A class counts as named when it is in `classes`. "Exact" wants every true effect in a class of its own or shared with another true
effect, and no class left without a true effect of its own: two classes for one truth are one too many.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.stats import binomtest

from benchmarks.truth import Truth

Document = Mapping[str, Any]
FRESH_LIMIT = 1.05


@dataclass(frozen=True)
class Score:
    """What one diagnosis got right; None where the question does not arise."""

    scenario: str
    truth: tuple[str, ...]
    named: tuple[tuple[str, ...], ...]
    in_class: bool | None
    exact: bool | None
    named_something: bool
    called_inadequate: bool
    mean_class_size: float | None
    scope_right: bool | None
    sensor_called_station: bool | None
    driver_right: bool | None
    none_of_catalogue: bool | None
    invisible_named: bool | None
    invisible_listed: bool | None
    fault_caught: bool | None
    fault_named: bool | None
    false_fault: bool
    fresh_ratio: float | None
    oracle_ratio: float | None
    seconds: float

    def row(self) -> dict[str, Any]:
        """The score as plain types, for a table."""
        return asdict(self)


def _classes(document: Document) -> list[tuple[frozenset[str], str]]:
    return [(frozenset(entry["effects"]), str(entry.get("scope", "sensor"))) for entry in document.get("classes", ())]


def _every_class_has_its_own(classes: Sequence[frozenset[str]], truths: Sequence[str]) -> bool:
    """Whether each class can be given a true effect that no other class is given."""
    if not classes:
        return True
    if not truths:
        return False
    holds = csr_matrix([[name in group for name in truths] for group in classes], dtype=np.int8)
    return bool((maximum_bipartite_matching(holds, perm_type="column") >= 0).all())


def _drivers(document: Document) -> set[str]:
    unexplained = document.get("unexplained")
    drivers = {str(unexplained["driver"])} if unexplained else set[str]()
    named = [name for group, _ in _classes(document) for name in group]
    return drivers | {name.partition(":")[2] for name in named if name.startswith("covariate:")}


def _faults(document: Document, truth: Truth) -> tuple[bool | None, bool | None, bool]:
    """Whether every faulty unit was blocked, under an accepted name, and whether a clean unit was accused."""
    blocked = [(str(entry["fault"]), set(map(str, entry["units"]))) for entry in document.get("blocked_by", ())]
    guilty = {unit for fault in truth.faults for unit in fault.units}
    accused = {unit for _, units in blocked for unit in units}
    if not truth.faults:
        return None, None, bool(blocked)
    named = all(
        all(any(unit in units and name in fault.accepted for name, units in blocked) for unit in fault.units)
        for fault in truth.faults
    )
    return guilty <= accused, named, bool(accused - guilty)


def score(
    document: Document, truth: Truth, *, scenario: str = "", fresh_rms_ug: float | None = None, seconds: float = 0.0
) -> Score:
    """The score of one diagnosis, `document` with the keys of `tumbleline diagnose --json`, against the sealed truth."""
    classes = _classes(document)
    groups = [group for group, _ in classes]
    catalogue = tuple(e.id for e in truth.effects if e.visible and not e.id.startswith("withheld:"))
    withheld = tuple(e.id for e in truth.effects if e.id.startswith("withheld:"))
    unseen = tuple(e.id for e in truth.effects if not e.visible)
    effects = {e.id: e for e in truth.effects}
    driver = truth.accepted_drivers
    held = [name for name in catalogue if any(name in group for group in groups)]
    in_class = len(held) == len(catalogue) if catalogue else None
    own = [group for group in groups if not any(name == f"covariate:{column}" for name in group for column in driver)]
    scoped = [(effects[name].scope, scope) for name in held for group, scope in classes if name in group]
    caught, named, false_fault = _faults(document, truth)
    return Score(
        scenario=scenario,
        truth=tuple(e.id for e in truth.effects),
        named=tuple(tuple(sorted(group)) for group in groups),
        in_class=in_class,
        exact=(in_class and _every_class_has_its_own(groups, catalogue)) if catalogue else None,
        named_something=bool(groups),
        called_inadequate=not document.get("adequate", True),
        mean_class_size=float(np.mean([len(group) for group in groups])) if groups and catalogue else None,
        scope_right=all(real == said for real, said in scoped)
        if any(real == "station" for real, _ in scoped)
        else None,
        sensor_called_station=(
            any(said == "station" for _, said in classes)
            if catalogue and all(effects[name].scope == "sensor" for name in catalogue) and groups
            else None
        ),
        driver_right=bool(_drivers(document) & set(driver)) if driver else None,
        none_of_catalogue=not own if withheld else None,
        invisible_named=any(name in group for name in unseen for group in groups) if unseen else None,
        invisible_listed=set(unseen) <= set(document.get("unseen", ())) if unseen else None,
        fault_caught=caught,
        fault_named=named,
        false_fault=false_fault,
        fresh_ratio=None if fresh_rms_ug is None else fresh_rms_ug / truth.fresh_floor_ug,
        oracle_ratio=None if fresh_rms_ug is None else fresh_rms_ug / truth.oracle_fresh_ug,
        seconds=seconds,
    )


def wilson(hits: int, count: int, level: float = 0.95) -> tuple[float, float]:
    """Wilson's score interval of a share (Wilson, JASA 22, 1927, p. 209)."""
    if count == 0:
        return 0.0, 1.0
    interval = binomtest(hits, count).proportion_ci(level, "wilson")
    return float(interval.low), float(interval.high)


@dataclass(frozen=True)
class Figure:
    """One row of the table: a share of the runs of some scenarios, or a mean; `wanted` is the bound it is held to."""

    title: str
    scenarios: tuple[str, ...]
    field: str
    wanted: str
    mean: bool = False
    limit: float | None = None  # the share of runs at or under it


LOTS = ("lot8_size2", "lot8_size1")
ONE_EFFECT = ("lot8_size2", "lot8_size1", "lot8_size05", "lot8_size4", "station_size2", "lot4_size2", "lot16_size2")
NULLS = ("null_white", "null_flicker")
CLEAN = (*ONE_EFFECT, *NULLS, "null_single", "null_walk", "single_size2", "pairs", "triples", "covariate_line", "covariate_curve",
         "withheld", "invisible")  # fmt: skip
FIGURES = (
    Figure("lots of 8: truth in its class, size 2", ("lot8_size2",), "in_class", "≥ 99 %"),
    Figure("lots of 8: truth in its class, size 1", ("lot8_size1",), "in_class", "≥ 99 %"),
    Figure("lots of 8: truth in its class, size 0.5", ("lot8_size05",), "in_class", "≥ 75 %"),
    Figure("lots of 8: truth in its class, size 4", ("lot8_size4",), "in_class", "≥ 99 %"),
    Figure("lots of 8: exact, size 2", ("lot8_size2",), "exact", "≥ 97 %"),
    Figure("lots of 8: exact, size 1", ("lot8_size1",), "exact", "≥ 95 %"),
    Figure("lots of 8: exact, size 4", ("lot8_size4",), "exact", "—"),
    Figure("single units: exact, size 2", ("single_size2",), "exact", "≥ 95 %"),
    Figure("lots of 4: exact, size 2", ("lot4_size2",), "exact", "—"),
    Figure("lots of 16: exact, size 2", ("lot16_size2",), "exact", "—"),
    Figure("mean class size", (*LOTS, "lot8_size4"), "mean_class_size", "≤ 1.5", mean=True),
    Figure("null, white: an effect named", ("null_white",), "named_something", "≤ 0.5 %"),
    Figure("null, strong 1/f: an effect named", ("null_flicker",), "named_something", "≤ 0.5 %"),
    Figure("null, random walk beside 1/f: an effect named", ("null_walk",), "named_something", "—"),
    Figure("null, single unit: an effect named", ("null_single",), "named_something", "≤ 0.5 %"),
    Figure("null: called inadequate at nominal 5 %", NULLS, "called_inadequate", "3–7 %"),
    Figure("two effects: exact", ("pairs",), "exact", "≥ 92 %"),
    Figure("three effects: exact", ("triples",), "exact", "≥ 80 %"),
    Figure("station effect called station", ONE_EFFECT, "scope_right", "≥ 97 %"),
    Figure("sensor effect called station", ONE_EFFECT, "sensor_called_station", "≤ 1 %"),
    Figure("unknown covariate, line: driver named", ("covariate_line",), "driver_right", "≥ 95 %"),
    Figure("unknown covariate, curve: driver named", ("covariate_curve",), "driver_right", "≥ 95 %"),
    Figure("withheld: none of the catalogue named", ("withheld",), "none_of_catalogue", "≥ 90 %"),
    Figure("withheld: right driver", ("withheld",), "driver_right", "≥ 90 %"),
    Figure("invisible effect named", ("invisible",), "invisible_named", "0"),
    Figure("invisible effect listed as unseen", ("invisible",), "invisible_listed", "100 %"),
    Figure("one effect: fresh run ≤ 1.05 of the true noise", LOTS, "fresh_ratio", "≥ 95 %", limit=FRESH_LIMIT),
    Figure("one effect: fresh run ≤ 1.05 of the true model's", LOTS, "oracle_ratio", "—", limit=FRESH_LIMIT),
    Figure("bare model over temperature: exact", ("bare_model",), "exact", "—"),
    Figure("fault caught, unit blocked", ("faults",), "fault_caught", "100 %"),
    Figure("fault called by its name", ("faults",), "fault_named", "—"),
    Figure("false fault alarm on a clean run", CLEAN, "false_fault", "≤ 0.5 %"),
)


def _line(figure: Figure, scores: Sequence[Score]) -> dict[str, Any] | None:
    values = [getattr(s, figure.field) for s in scores if s.scenario in figure.scenarios]
    values = [value for value in values if value is not None]
    if not values:
        return None
    row: dict[str, Any] = {"figure": figure.title, "wanted": figure.wanted, "runs": len(values)}
    if figure.mean:
        return row | {"value": float(np.mean(values)), "low": None, "high": None, "unit": ""}
    hits = sum(value <= figure.limit for value in values) if figure.limit is not None else sum(map(bool, values))
    low, high = wilson(hits, len(values))
    return row | {"value": 100.0 * hits / len(values), "low": 100.0 * low, "high": 100.0 * high, "unit": " %"}


def table(scores: Iterable[Score]) -> list[dict[str, Any]]:
    """The figures that these scores speak of, each with its Wilson interval at 95 %."""
    scores = list(scores)
    return [line for figure in FIGURES if (line := _line(figure, scores)) is not None]


def text(rows: Sequence[Mapping[str, Any]]) -> str:
    """The table for people, one line per figure."""
    lines = [f"{'figure':52} {'wanted':>8} {'runs':>5} {'measured':>9}  95 %"]
    for row in rows:
        band = "" if row["low"] is None else f"{row['low']:5.1f}–{row['high']:5.1f} %"
        lines.append(
            f"{row['figure']:52} {row['wanted']:>8} {row['runs']:5d} {row['value']:7.1f}{row['unit']:2}  {band}"
        )
    return "\n".join(lines)
