"""Looks during a capture: the chain on the records so far, and whether every unit of the lot is known.

A look is the fit, the budget and the decisions that the run would end with if it ended now; nothing is computed in another way.
A unit is known when its figures pass and its uncertainties are those that ``[stop]`` asks for, or when a coefficient fails, all
with the allowance of :mod:`inertial.fits.known` for a noise that the same dwells show.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.arrays import Array
from inertial.errors import InertialError
from inertial.fits.known import DwellNoise, chosen_length, largest_ratio, noise_guard, over_looks
from inertial.planning.visibility import visibilities
from pipelines.archive import Records
from pipelines.capture.look import Look
from pipelines.chain.in_memory import evaluated
from pipelines.jobs.job import Job
from pipelines.planning.soak_order import look_counts
from pipelines.planning.timed_design import SHORTEST_DWELL_S
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.steps import TUMBLED, steps
from pipelines.schedule.timing import schedule
from pipelines.stages.figures import coefficients, errors
from pipelines.stages.figures.base import LotCoefficients
from pipelines.stages.grade import grade
from pipelines.stages.judge import verdict_on
from pipelines.stages.noise import noise
from pipelines.stages.reduce import reduce
from pipelines.stages.validate import validate
from pipelines.tables.dwells import LotTables
from pipelines.tables.summaries import summarised
from schemas.decisions import beside_limit
from schemas.errors import TumblelineError
from schemas.limits import Limits
from schemas.recipe import FEWEST_SAMPLES
from schemas.stopping import StopTerms
from schemas.units import MICRO

BLOCKS = 5
"""Parts of the recipe's dwell in which its length is chosen: as often as the station is observed within it."""

BEFORE_THE_RECORD = frozenset(kind.name for kind in (*coefficients.FIGURES, *errors.FIGURES))
"""Figures of the dwells: those of the static record and of procedures are decided at the end of the run."""

OF_COEFFICIENTS = frozenset(kind.name for kind in coefficients.FIGURES)
"""Figures that fail for good: their uncertainty is that of the coefficients. A figure of verification may fail by one dwell."""


class LotLooks:
    """Looks at the records of a job while they are captured."""

    def __init__(self, job: Job, terms: StopTerms, records: Records) -> None:
        self.job, self.terms, self.records = job, terms, records
        self._summaries: dict[int, pd.DataFrame] = {}
        self._activities = schedule(steps(job.recipe), job.station, job.recipe)
        dwells = [activity.step.record for activity in self._activities if activity.kind == "dwell"]
        self._dwells = len(dwells)
        self._due = {dwells[count - 1] for count in look_counts(self._activities, job.station, job.recipe)}

    def due(self, record: int) -> bool:
        """Whether the records so far are evaluated after this record."""
        return record in self._due

    def look(self, record: int, reported: frozenset[str]) -> Look:
        """The evaluation of the records up to this record."""
        with threadpool_limits(1):
            try:
                return self._look(record, reported)
            except (TumblelineError, InertialError) as problem:
                return Look(known=False, text=f"cannot be judged yet: {problem}")

    def _look(self, record: int, reported: frozenset[str]) -> Look:
        state = _Evaluated(self.job, self._readings(), self._summary(), self.records.gathered("history"))
        if not state.units:
            return Look(known=False, text="no unit is fitted")
        limits, zero_g, looks = self.job.limits, self.job.recipe.zero_output, len(self._due)
        guard = noise_guard(state.dof, looks)
        wide = limits.model_copy(
            update={
                "rule": "guarded_acceptance",
                "coverage_factor": over_looks(limits.coverage_factor, looks) * guard,
            }
        )
        plain, guarded = (grade(state.evidence, rule, zero_g) for rule in (limits, wide))
        fails = dict(reversed(list(_failed(guarded["figures"]))))
        figures = _open_figures(plain["figures"], guarded["figures"], limits, state.units)
        passed = set(plain["grades"].query("outcome == 'pass'")["unit"]) - figures.keys()
        ratio = limits.coverage_factor * state.ratios(self.terms.asked, zero_g)
        fitted = dict(zip(state.units, ratio.tolist(), strict=True))
        reached = {unit for unit, share in fitted.items() if guard * share <= 1.0}
        undecided = fitted.keys() - (passed & reached) - fails.keys()
        ratios = [share for unit, share in fitted.items() if unit not in fails]
        worst = max(ratios, default=0.0)
        asked = _share(worst, guard, others=bool(fails)) if self.terms.asked and ratios else ""
        lost = len(plain["grades"]) - len(fitted)
        not_fitted = f", {lost} not fitted" if lost else ""
        decided = f"{len(fitted) - len(undecided)} of {len(fitted)} units decided{not_fitted}"
        text = f"{asked}{decided}{_most_often(figures, undecided)}"
        new = {unit: sentence for unit, sentence in fails.items() if unit not in reported}
        missing = "" if undecided else self._missing(record, state)
        if undecided or missing:
            return Look(
                known=False,
                text=text + missing,
                fails=new,
                dwell_s=self._length(state, guard * worst * np.sqrt(state.count / self._dwells)),
            )
        return Look(known=True, text=text, fails=new, given_up=self._given_up(record))

    def _missing(self, record: int, state: "_Evaluated") -> str:
        """The reason why the lot may not end yet, with a leading semicolon; empty where it may."""
        if self.terms.visible:
            effects = self.job.recipe.effects
            rows = visibilities(self._state(record), effects, 1.0, self.terms.visible)
            unseen = [row.effect for row in rows if not row.seen]
            if unseen:
                return f"; {', '.join(unseen)} not visible yet"
        verdict = verdict_on(state.lot.dwells, state.lot.history, self.job.recipe.effects)
        if verdict["adequate"] is None:
            return f"; whether the model is adequate cannot be judged yet: {verdict['reason']}"
        return "" if verdict["adequate"] else "; the model is not adequate, a diagnosis needs the other dwells"

    def _given_up(self, record: int) -> tuple[str, ...]:
        """Effects that the whole plan would show, and the dwells so far do not."""
        seen = [
            {row.effect for row in visibilities(self._state(last), self.job.recipe.effects, 1.0) if row.seen}
            for last in (record, self._activities[-1].step.record)
        ]
        return tuple(sorted(seen[1] - seen[0]))

    def _state(self, record: int) -> Any:
        """The planned dwells up to a record."""
        until = [activity for activity in self._activities if activity.step.record <= record]
        return state_of(until, self.job.station, self.job.recipe, history=True)

    def _readings(self) -> pd.DataFrame:
        readings = self.records.gathered("readings")
        return readings[readings["kind"].isin(list(TUMBLED))].reset_index(drop=True)

    def _summary(self) -> pd.DataFrame:
        """Summaries of the samples so far; each record is decoded once."""
        readings, recipe = self._readings(), self.job.recipe
        new = set(readings["record"].tolist()) - self._summaries.keys()
        rows = summarised(self.records.samples(new), readings, recipe.zero_output, recipe.sensor_axes)
        self._summaries |= {record: rows[rows["record"] == record] for record in new}
        return pd.concat([self._summaries[record] for record in sorted(self._summaries)], ignore_index=True)

    def _length(self, state: "_Evaluated", expected: float) -> float | None:
        """The length of the next dwells in blocks, s; None where it stays.

        expected : U over what is asked for at the end of the plan
        """
        recipe, longest = self.job.recipe, self.terms.longest_dwell_s
        if longest is None or state.dwell is None:
            return None
        block = recipe.dwell_s / BLOCKS
        count = int(longest / block + 1e-9)
        lengths = np.linspace(block, count * block, count)
        shortest = max(SHORTEST_DWELL_S, FEWEST_SAMPLES / recipe.rate_hz)
        lengths = lengths[lengths >= shortest - 1e-9]
        if not lengths.size:
            return None
        return round(chosen_length(state.dwell, recipe.dwell_s, lengths, enough=expected <= 1.0), 6)


class _Evaluated:
    """The records so far, evaluated as the end of the run would.

    units : those that were fitted; dof : of the noise of the lot
    dwell : their noise, µg; None where there is one dwell
    """

    def __init__(self, job: Job, readings: pd.DataFrame, summaries: pd.DataFrame, history: pd.DataFrame) -> None:
        recipe, terms = job.recipe, job.terms
        verdicts = validate(summaries, readings, job.lot.units)
        dwells = reduce(summaries, readings, verdicts, recipe.local_gravity_m_s2, terms.follows)
        self.lot = LotTables(dwells, history)
        first = readings.drop_duplicates("unit")
        full = dict(zip(first["unit"].astype(str), first["full_scale"].astype(float), strict=True))
        # the static record comes after the poses: its figures are decided at the end of the run
        made, self.evidence = evaluated(job, self.lot, verdicts, noise(None)["noise"], full)
        self.units = () if self.evidence.calibration is None else self.evidence.calibration.units
        wander = made["wander"]
        self.dof = max(int(wander["dof"].sum()), 1)
        fitted = readings[readings["kind"] == "dwell"].drop_duplicates("record")
        self.count = len(fitted)
        gaps = [b - a for a, b in pairwise(fitted["start_s"])]
        white, flicker = (float(np.sqrt(np.mean(wander[name] ** 2))) for name in ("white_ug", "flicker_ug"))
        length = float(np.median(fitted["duration_s"]))
        self.dwell = DwellNoise(white, flicker, length, float(np.median(gaps))) if gaps and len(wander) else None

    def ratios(self, asked: dict[str, float], zero_g: float) -> Array:
        """Largest standard uncertainty over what is asked for, (units,)."""
        calibration, stated = self.evidence.calibration, self.evidence.budget
        if calibration is None:
            return np.zeros(0)
        lot = LotCoefficients(calibration, zero_g, None if stated is None else stated.covariance)
        worst = [
            [MICRO * float(np.max(spread / scale)) for _, spread, scale in (lot.effect(e, u) for e in asked)]
            for u in range(len(calibration.units))
        ]
        return largest_ratio(np.array(worst).reshape(len(worst), 1, len(asked)), list(asked), asked)


def _open_figures(
    plain: pd.DataFrame, guarded: pd.DataFrame, limits: Limits, units: Sequence[str]
) -> dict[str, frozenset[str]]:
    """Limited figures of the dwells that do not pass, by unit: coefficients by the guarded rule, verification by the plain rule.

    Further dwells of the fit hardly change a figure of verification, so that looks do not give it more chances to pass.
    """
    needed = BEFORE_THE_RECORD & limits.figures.keys()
    of_fit = guarded[guarded["figure"].isin(list(OF_COEFFICIENTS))]
    of_checks = plain[~plain["figure"].isin(list(OF_COEFFICIENTS))]
    rows = pd.concat([of_fit, of_checks]).query("outcome == 'pass'")
    left = {unit: frozenset(needed - set(rows.loc[rows["unit"] == unit, "figure"])) for unit in units}
    return {unit: names for unit, names in left.items() if names}


def _share(worst: float, guard: float, *, others: bool) -> str:
    """The largest U over what is asked for in words, and the allowance of a look, which is no part of U."""
    whose = " of the units that do not fail" if others else ""
    return f"U{whose} at most {worst:.2f} of what is asked (times {guard:.2f} as allowance for its noise), "


def _most_often(figures: Mapping[str, frozenset[str]], undecided: Collection[str]) -> str:
    """The figure that keeps most units undecided, with a leading semicolon; empty where none does."""
    counts = Counter(name for unit in undecided for name in sorted(figures.get(unit, ())))
    return "".join(f"; {name} open in {count}" for name, count in counts.most_common(1))


def _failed(figures: pd.DataFrame) -> Iterator[tuple[str, str]]:
    """Units with a coefficient beyond its limit by more than its uncertainty, and the figure in words."""
    failed = figures[(figures["outcome"] == "fail") & figures["figure"].isin(list(OF_COEFFICIENTS))]
    for row in failed.to_dict("records"):
        unit = "" if row["unit_text"] == "1" else f" {row['unit_text']}"
        yield str(row["unit"]), f"{row['figure']} {beside_limit(row['value'], row['uncertainty'], row['limit'], unit)}"
