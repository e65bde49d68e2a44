"""Does the next measurement part what it says? A run with a blind spot, its diagnosis, and the devices measured on as proposed.

The table, chamber, devices and noise go on from where the run ended: 1/f and walk without a break, the chamber's ramps and the
lag of the sensors with this generator's own figures. Nothing of the product's prediction is used but the proposed steps.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from continued_run import LAG, MOVE, RAMP, SCENES, SETTLED, Blind, Continued, Step


def first_looks(task: tuple[str, str, int]) -> tuple[str, dict[str, Any]]:
    """What the first diagnosis of a scene says, beside the truth; nothing is measured on."""
    from pipelines.diagnosis.diagnose import diagnose

    _, name, seed = task
    blind, begin = SCENES[name], time.process_time()
    document = diagnose(*Continued(blind, seed).tables())
    groups = [set(g["effects"]) for g in document["classes"]]
    held = [g for g in groups if blind.effect in g]
    return name, {
        "seed": seed,
        "seconds": time.process_time() - begin,
        "named": [g["effects"] for g in document["classes"]],
        "held": bool(held),
        "alone": any(len(g) == 1 for g in held),
        "beside": [sorted(g) for g in groups if blind.effect not in g],
        "unexplained": (document["unexplained"] or {}).get("driver"),
        "unseen": blind.effect in document["unseen"],
        "adequate": document["adequate"],
        "blocked": [b["fault"] for b in document["blocked_by"]],
    }


def followed(task: tuple[str, int]) -> tuple[str, dict[str, Any]]:
    """One run: the proposals of its diagnosis, measured, and what they parted."""
    name, seed = task
    begin = time.process_time()
    outcome = _followed(SCENES[name], seed)
    return name, {"seed": seed, "seconds": time.process_time() - begin, **outcome}


def _followed(blind: Blind, seed: int) -> dict[str, Any]:
    from threadpoolctl import threadpool_limits

    from inertial.next_measurement.proposals import Circumstances
    from inertial.planning.sequences import StationPace
    from pipelines.diagnosis.diagnose import examined
    from pipelines.diagnosis.next_measurement import proposed

    # what a station's file says of its chamber and table
    pace = StationPace(move_s=MOVE, dwell_s=10.0, ramp=RAMP, lag=LAG, soak_s=900.0, settled=SETTLED)
    run = Continued(blind, seed)
    dwells, history = run.tables()
    with threadpool_limits(1):
        _, _, diagnosis = examined(dwells, history, None)
        if diagnosis is None:
            return {"ended": "blocked", "classes": []}
        following = proposed(diagnosis, Circumstances(pace=pace))
        classes = [list(n.effects.ids) for n in diagnosis.named]
        answer: dict[str, Any] = {"classes": classes, "proposals": [], "twins": []}
        held = [group for group in classes if blind.effect in group]
        answer["ended"] = "open" if held and len(held[0]) > 1 else "clear" if held else "not named"
        for group, wanted in following.parting:
            if blind.effect not in group.ids:
                continue
            if wanted is None:
                answer["ended"] = "no proposal"
                continue
            steps = [Step(s.outer, s.inner, round(s.temperature, 2), s.wait, s.soaked, 900.0) for s in wanted.steps]
            answer["proposals"].append(_measured(run, blind.effect, wanted, steps, diagnosis))
    return answer


def _measured(run: Continued, truth: str, wanted: Any, steps: list[Step], before: Any) -> dict[str, Any]:
    """What a proposal parted, and by how much, when it was measured."""
    from pipelines.diagnosis.diagnose import examined

    _, _, after = examined(*run.tables(steps), None)
    one, other = wanted.pair
    groups = [list(n.effects.ids) for n in after.named] if after is not None else []
    wrong = other if truth == one else one
    promised = dict(wanted.if_true).get(truth)
    measured = added = same_noise = None
    if after is not None and promised is not None:
        measured = separation(after, truth, wrong)
        # of what the steps add, luck apart: the devices without their noise, judged by the noise that was there
        expected = promised - separation(before, truth, wrong)
        clean = separation(after, truth, wrong, run.tables(steps, quiet=True))
        clean -= separation(before, truth, wrong, run.tables(quiet=True))
        added = clean / max(expected, 1e-9)
        # the same at the noise that was known when it was promised: what is left is the prediction of the physics
        clean = separation(after, truth, wrong, run.tables(steps, quiet=True), of=before)
        same_noise = (clean - separation(before, truth, wrong, run.tables(quiet=True))) / max(expected, 1e-9)
    return {
        "pair": list(wanted.pair), "minutes": wanted.minutes, "steps": len(steps), "promised": promised,
        "measured": measured, "added": added, "same_noise": same_noise,
        "after": groups, "kinds": list(wanted.kinds),
        # of a pair without the truth neither is right: parted is what leaves neither with the truth
        "parted": any(truth in g for g in groups) and not any(truth in g and wrong in g for g in groups)
        if truth in wanted.pair else any(truth in g for g in groups) and not any({one, other} <= set(g) for g in groups),
    }  # fmt: skip


def separation(diagnosis: Any, truth: str, wrong: str, instead: Any = None, *, of: Any = None) -> float:
    """Chi-square by which the wrong one of two leaves more than the true one, both fitted to everything measured.

    ``instead`` are tables of the same dwells to be fitted in place of those of the diagnosis, at its noise or at that of the
    diagnosis ``of``.
    """
    whose = of or diagnosis
    from inertial import effects as catalogue
    from inertial.design import grid_of
    from inertial.estimation.model import Model
    from inertial.estimation.problem import Problem
    from inertial.estimation.refinement import refine
    from inertial.estimation.term import Term
    from pipelines.tables.dwells import lot_of, measured

    problem, rest, noise = diagnosis.problem, diagnosis.base.terms, whose.final.noise
    if instead is not None:
        problem = Problem(lot_of(measured(*instead)))
        noise = problem.covariance.rescaled(noise, whose.problem.covariance)
    base = Model(problem, rest)
    left = []
    for name in (wrong, truth):
        effect = catalogue.get(name)
        # as many columns as an effect has in a class, the state of its memory unknown
        terms = [
            Term(effect, tuple(values.items()), first=effect.primary) for values in grid_of(effect, problem.lot.state)
        ]
        squares = [Model(problem, [*rest, term]).at(noise).rss for term in terms]
        best = refine(base, terms[int(np.argmin(squares))], noise)
        left.append(min(*squares, Model(problem, [*rest, best]).at(noise).rss))
    return float((left[0] - left[1]) / whose.final.space.variance)
