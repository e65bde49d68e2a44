"""The early end of a lot whose units are known: which records it leaves out, and what a run keeps of it."""

from collections.abc import Sequence
from typing import Annotated

from typing_extensions import TypedDict

from pipelines.archive import Run
from pipelines.schedule.steps import TUMBLED, Step, steps
from pipelines.tables.frames import rows_of
from schemas.recipe import Recipe


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


class EarlyEnd(TypedDict):
    """The end of a lot ahead of its plan, or the units that were told to fail before its end."""

    ended: Annotated[bool, "whether dwells of the plan were not taken"]
    reason: Annotated[str, "why the lot ended; empty where it did not end early"]
    dwells: Annotated[int, "dwells that were not taken"]
    soaks_C: Annotated[list[float], "temperatures that the chamber did not go to any more, °C"]
    dwell_s: Annotated[list[float], "shortest and longest dwell of the fit, s; the run may choose its length"]
    given_up: Annotated[list[str], "effects that the whole plan would have shown"]
    fails: Annotated[dict[str, str], "units that failed before the end, with the figure"]


def early_end(run: Run) -> EarlyEnd | None:
    """What ``[stop]`` of a run's recipe did; None without it."""
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
    reasons = [str(event["reason"]) for event in events if event["kind"] == "known"]
    return {
        "ended": bool(reasons),
        "reason": reasons[0] if reasons else "",
        "dwells": len(missing),
        "soaks_C": list(left.values()),
        "dwell_s": [float(lengths.min()), float(lengths.max())] if len(lengths) else [],
        "given_up": [str(event["action"]) for event in events if event["kind"] == "given_up"],
        "fails": {
            str(event["action"]).split()[1]: str(event["reason"]) for event in events if event["kind"] == "fails"
        },
    }


def early_end_sentence(end: EarlyEnd) -> str:
    """The early end in words, for summary, report and certificate; empty where the plan was measured as it stands."""
    lengths = " to ".join(f"{seconds:.3g}" for seconds in dict.fromkeys(end["dwell_s"]))
    chosen = f"dwells of {lengths} s by the noise of the run" if len(set(end["dwell_s"])) > 1 else ""
    if not end["ended"]:
        return chosen
    soaks = ", ".join(f"{t:g}" for t in end["soaks_C"])
    parts = [f"ended when it was known: {end['reason']}", f"{end['dwells']} dwells of the plan not taken"]
    if soaks:
        parts[-1] += f", no soak at {soaks} °C any more"
    if end["given_up"]:
        parts.append(f"given up: {', '.join(end['given_up'])}, which the whole plan shows")
    return "; ".join([*parts, *([chosen] if chosen else [])])
