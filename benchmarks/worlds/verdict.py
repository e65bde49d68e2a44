"""What the diagnosis says in a world, beside the truth."""

from __future__ import annotations

import time
import traceback
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from physics import OUTSIDE
from tables import LOOP, RIGHT, TABLES, WRONG
from world import Made, World, make

Making = Callable[[World, int], Made]
BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
DATA = {"data"}


def diagnosed(task: tuple[str, str, int], making: Making = make) -> tuple[str, dict[str, Any]]:
    """What the diagnosis says of one run, beside the truth."""
    from pipelines.diagnosis.diagnose import diagnose

    table, name, seed = task
    world: World = TABLES[table][name]
    made = making(world, seed)
    begin = time.process_time()
    try:
        document = diagnose(made.dwells, made.history)
    except Exception:  # noqa: BLE001  # a benchmark tells what broke and goes on
        return name, {"broken": traceback.format_exc(), "seed": seed}
    return name, {"seed": seed, "seconds": time.process_time() - begin, **judged(world, made, document)}


def judged(world: World, made: Made, document: dict[str, Any]) -> dict[str, Any]:
    """The verdict on a document."""
    groups = document["classes"]
    physics = [g for g in groups if g.get("scope") not in DATA]
    own = {name for name, _ in world.hidden}
    stray = [g["effects"] for g in physics if not own & set(g["effects"])]
    # a fault that stands in a class with physics is told, and physics alone is not
    for told in made.faults:
        stray = [effects for effects in stray if not set(told.names) & set(effects)]
    said = [(set(g["effects"]), g.get("units") or [], g.get("dwells") or []) for g in groups]
    said += _blocked(document)
    found = all(any(_agrees(told, *one) for one in said) for told in made.faults) if made.faults else None
    return {
        "adequate": document["adequate"],
        "named": [g["effects"] for g in groups],
        "stray": stray,
        "unexplained": document["unexplained"] is not None,
        "left_out": _left_out(made, document),
        "blocked": [(b["fault"], b["units"], b["dwells"]) for b in document["blocked_by"]],
        "found": found,
        "false": [(sorted(one[0]), *one[1:]) for one in said if not any(_agrees(told, *one) for told in made.faults)],
        "first": bool(groups) and bool(own & set(groups[0]["effects"])),
        "outside": bool(own & set(OUTSIDE)),
        "held": all(any(name in g["effects"] for g in groups) for name in own) if own - set(OUTSIDE) else None,
        # beside a fault of the data that is there its class is right, and no other one is
        "alone": len(physics) == len(own) and found is not False and len(groups) - len(physics) <= len(made.faults)
        if own
        else None,
        "p": document["error"]["p_value"],
        "hidden": [list(own)],
        "first_p": [g["p_value"] for g in groups],
        "said": [(sorted(a), b, c) for a, b, c in said],
        "truth": [(told.names, told.units, told.dwells) for told in made.faults],
    }


def _blocked(document: dict[str, Any]) -> list[tuple[set[str], list[str], list[int]]]:
    """Data faults: one of several units in the same dwells is one."""
    together: dict[tuple[str, tuple[int, ...]], list[str]] = defaultdict(list)
    for b in document["blocked_by"]:
        together[b["fault"], tuple(b["dwells"])] += b["units"]
    return [({fault}, units, list(dwells)) for (fault, dwells), units in together.items()]


def _left_out(made: Made, document: dict[str, Any]) -> bool | None:
    """Whether every spoilt dwell was left out, named or not; None where none was spoilt."""
    spoilt = [(told.units[0], dwell) for told in made.faults if told.names == ("bad_dwell",) for dwell in told.dwells]
    gone = {(d["unit"], d["dwell"]) for d in (document.get("removed") or {"dwells": []})["dwells"]}
    return set(spoilt) <= gone if spoilt else None


def _agrees(told: Any, names: set[str], units: list[str], dwells: list[int]) -> bool:
    """Whether what was said is the fault: its name, its units, a dwell within one of its own."""
    if not names & set(told.names):
        return False
    if told.units and set(told.units) != set(units):
        return not units and names != {"bad_dwell"}
    return not told.dwells or not dwells or any(abs(d - t) <= 1 for d in dwells for t in told.dwells)


def looped(task: tuple[str, str, int], making: Making = make) -> tuple[str, dict[str, Any]]:
    """Whether wrong effects are confirmed, and right ones of two floors, with and without a fresh run."""
    _, name, seed = task
    confirmed: dict[str, list[tuple[str, bool | None]]] = defaultdict(list)
    empty = making(LOOP[name], seed)
    for kind, effects in (("wrong", WRONG), ("right", RIGHT)):
        for effect in effects:
            made = empty if kind == "wrong" else making(replace(LOOP[name], hidden=((effect, 2.0),)), seed)
            ways = {"fresh": (made.fresh, made.fresh_history), "left out": (None, None)}
            if LOOP[name].fresh_noise is not None:
                del ways["left out"]
            for where, again in ways.items():
                confirmed[f"{kind} {where}"].append((effect, _confirmed(made, effect, again)))
    return name, dict(confirmed)


def _confirmed(made: Made, effect: str, again: tuple[Any, Any]) -> bool | None:
    """The verdict on an effect that is added to the plain model."""
    from pipelines.diagnosis.compare import compare
    from pipelines.diagnosis.confirmation import evolution
    from pipelines.jobs.model_files import Version

    versions = [Version(1, BASE, (), (), None), Version(2, (*BASE, effect), (effect,), (), None)]
    return evolution(versions, lambda model, before: compare(made.dwells, model, made.history, *again, before=before))[
        -1
    ]["confirmed"]
