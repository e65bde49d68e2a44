"""The early end of a lot whose units are known: which records it leaves out, and what a run keeps of it."""

from collections.abc import Iterator, Sequence
from typing import Annotated

import pandas as pd
from typing_extensions import TypedDict

from inertial.counts import number_of
from pipelines.archive import Run
from pipelines.schedule.steps import TUMBLED, Step, steps
from pipelines.tables.frames import rows_of
from schemas.recipe import Recipe
from schemas.units import MICRO


def left_out(plan: Sequence[Step], at: int) -> list[Step]:
    """The steps that an end of the multi-position test after step ``at`` leaves out.

    A pose of verification that the present soak has not had yet is still measured once: the temperature would have no check.
    """
    here, missing = plan[at].soak, list[Step]()
    checked = {_check(step) for step in plan[: at + 1] if step.kind == "verification"}
    for step in plan[at + 1 :]:
        if step.kind not in TUMBLED:
            continue
        if step.kind == "verification" and step.soak == here and _check(step) not in checked:
            checked.add(_check(step))
        else:
            missing.append(step)
    return missing


def _check(step: Step) -> tuple[str, int]:
    """Pose and soak of a step of verification; on a ramp, the pose in the whole run."""
    return step.pose.name, step.soak if step.settled else -1


class NotReached(TypedDict):
    """An uncertainty that ``[stop]`` asks for, and that a unit's calibration does not have."""

    figure: Annotated[str, "effect of the coefficient"]
    unit: str
    share: Annotated[float, "U of the worst axis over what is asked for, above one"]


class EarlyEnd(TypedDict):
    """The end of a lot ahead of its plan, or the units that were told to fail before its end."""

    ended: Annotated[bool, "whether dwells of the plan were not taken"]
    reason: Annotated[str, "why the lot ended; empty where it did not end early"]
    dwells: Annotated[int, "dwells that were not taken"]
    soaks_C: Annotated[list[float], "temperatures that the chamber did not go to any more, °C"]
    dwell_s: Annotated[list[float], "shortest and longest dwell of the fit, s; the run may choose its length"]
    given_up: Annotated[list[str], "effects that the whole plan would have shown"]
    fails: Annotated[dict[str, str], "units that failed before the end, with the figure"]
    withdrawn: Annotated[list[str], "units among them that pass by the whole run"]
    not_reached: Annotated[list[NotReached], "uncertainties that were asked for and that the result does not have"]


def early_end(run: Run) -> EarlyEnd | None:
    """The effect of ``[stop]`` on a run; None where the recipe has none."""
    about = run.about
    if not (about.get("recipe") or {}).get("stop") or "events" not in run.tables():
        return None
    events = rows_of(run.table("events"))
    recipe = Recipe.model_validate(about["recipe"])
    readings = run.table("readings")
    taken, lengths = set(readings["record"]), readings.loc[readings["kind"] == "dwell", "duration_s"]
    plan = steps(recipe)
    missing = [step for step in plan if step.record not in taken]
    soaks = {step.soak for step in plan if step.record in taken}
    left = {step.soak: step.temperature for step in missing if step.soak not in soaks}
    by = f" (by run {about['rerun_of']}, which measured it)" if about.get("rerun_of") else ""
    reasons = [f"{event['reason']}{by}" for event in events if event["kind"] == "known"]
    fails = {str(event["action"]).split()[1]: str(event["reason"]) for event in events if event["kind"] == "fails"}
    grades = run.table("grades") if "grades" in run.tables() else None
    passed = set[str]() if grades is None else set(grades.loc[grades["outcome"] == "pass", "unit"])
    return {
        "ended": bool(reasons),
        "reason": reasons[0] if reasons else "",
        "dwells": len(missing),
        "soaks_C": list(left.values()),
        "dwell_s": [float(lengths.min()), float(lengths.max())] if len(lengths) else [],
        "given_up": [str(event["action"]) for event in events if event["kind"] == "given_up"],
        "fails": fails,
        "withdrawn": [unit for unit in fails if unit in passed],
        "not_reached": list(_not_reached(run, recipe)),
    }


def _not_reached(run: Run, recipe: Recipe) -> Iterator[NotReached]:
    """Quantities whose uncertainty (by noise alone where nothing is stated) exceeds what ``[stop]`` asks for."""
    if recipe.stop is None or not {"uncertainties", "coefficients"} <= set(run.tables()):
        return
    stated = run.table("uncertainties")
    if stated.empty:
        coefficients = run.table("coefficients")
        scale = coefficients[coefficients["effect"] == "scale"].set_index(["unit", "axis"])["value"].abs()
        per_g = scale.reindex(pd.MultiIndex.from_frame(coefficients[["unit", "axis"]])).to_numpy()
        stated = coefficients.assign(quantity=coefficients["effect"], u=MICRO * coefficients["standard_error"] / per_g)
    factor = run.about["limits"]["coverage_factor"]
    for effect, asked in recipe.stop.asked.items():
        largest = factor / asked * stated[stated["quantity"] == effect].groupby("unit", observed=True)["u"].max()
        for unit, share in largest[largest > 1.0].items():
            yield {"figure": effect, "unit": str(unit), "share": float(share)}


def told_sentences(end: EarlyEnd) -> list[str]:
    """The units that were told to fail before the end, in words."""
    withdrawn = dict.fromkeys(end["withdrawn"], "; withdrawn: by the whole run it passes")
    return [f"{unit} failed before the end: {figure}{withdrawn.get(unit, '')}" for unit, figure in end["fails"].items()]


def early_end_sentence(end: EarlyEnd, unit: str = "") -> str:
    """The early end in words, for summary, report and certificate; empty where the plan was measured as it stands.

    unit : whose uncertainties are worded; all units where empty
    """
    lengths = dwell_words(end)
    chosen = f"dwells of {lengths} s by the noise of the run" if len(set(end["dwell_s"])) > 1 else ""
    larger = ", ".join(
        f"{row['figure']} of {row['unit']} ({row['share']:.2f} of what is asked)"
        for row in end["not_reached"]
        if unit in ("", row["unit"])
    )
    last = [*([chosen] if chosen else []), *([f"asked uncertainty not reached: {larger}"] if larger else [])]
    if not end["ended"]:
        return "; ".join(last)
    soaks = ", ".join(f"{t:g}" for t in end["soaks_C"])
    parts = [f"ended when it was known: {end['reason']}", f"{number_of(end['dwells'], 'dwell')} of the plan not taken"]
    if soaks:
        parts[-1] += f", no soak at {soaks} °C any more"
    if end["given_up"]:
        parts.append(f"given up: {', '.join(end['given_up'])}, which the whole plan shows")
    return "; ".join([*parts, *last])


def dwell_words(end: EarlyEnd) -> str:
    """The length of the dwells of the fit as measured, or the shortest and the longest, s."""
    return " to ".join(f"{seconds:.3g}" for seconds in dict.fromkeys(end["dwell_s"]))
