"""The next measurement: steps that separate rivals of equal fit, or show unseen effects, by gain per minute of station time."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inertial import effects as catalogue
from inertial.arrays import Flags
from inertial.criticism.classes import EffectClass
from inertial.design import resting_grid
from inertial.errors import MissingInput
from inertial.estimation.model import Model
from inertial.estimation.term import Term
from inertial.next_measurement.aims import RivalDiscrimination, Sighting
from inertial.next_measurement.menus import TableReach, courses, pose_grid, present, reach_of, temperatures
from inertial.next_measurement.separation import FEW, MANY, Rivals, apart, rivals_of
from inertial.next_measurement.sequence_search import Circumstances, Proposal, ProposalSearch, drivers_of_term
from inertial.planning.sequences import SequenceStep, StationPace
from inertial.state import State

MICRO = 1e6

_MEMBERS = 6

NOTHING = 1e-6
"""Largest share of a truth's chi-square that an equivalent effect leaves after every step, by rounding."""

_EVERY, _FURTHER = 4, 12


def rivals_in(model: Model, group: EffectClass, most: int = FEW) -> Rivals | None:
    """The members of a class as rivals; None for a class of one member, or where the table angles are unknown."""
    if len(group.members) < 2 or not _has_angles(model):
        return None
    others = [t for t in model.terms if t.effect.id not in group.ids]
    return rivals_of(model, [m.term for m in group.members[:_MEMBERS]], others, most)


def proposal(
    model: Model, group: EffectClass, around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best separate the members of a class; None if no steps of the station reliably separate two of them.

    Parameters
    ----------
    already : steps already planned for another class, after which the proposal is measured
    """
    rivals, every = rivals_in(model, group), rivals_in(model, group, MANY)
    if rivals is None or every is None:
        return None
    around = around or Circumstances()
    never = _never_apart(rivals, around)
    if never[0, 1:].all():
        return None
    scores = np.array([m.score for m in group.members[:_MEMBERS]])
    proposed = ProposalSearch(RivalDiscrimination(rivals, scores, every, never), around, already).best()
    # a measurement that might separate no rivals is not worth its station time
    return (
        None
        if proposed is None or len(proposed.remaining) == len(rivals.terms) - 1
        else replace(proposed, ids=rivals.ids)
    )


def twins(model: Model, group: EffectClass, around: Circumstances | None = None) -> tuple[str, ...]:
    """Ids of the best member of a class and of those that no measurement of the station separates from it; else empty."""
    rivals = rivals_in(model, group)
    if rivals is None:
        return ()
    never = _never_apart(rivals, around or Circumstances())
    alike = [name for name, same in zip(rivals.ids, never[0], strict=True) if same]
    return (rivals.ids[0], *alike) if alike else ()


def sighting(
    model: Model, unseen: Sequence[str], around: Circumstances | None = None, already: Sequence[SequenceStep] = ()
) -> Proposal | None:
    """The steps that best show unseen effects; None if none can exceed the noise, or if the station can show none."""
    if not _has_angles(model):
        return None
    floor = MICRO * model.floor()
    around = around or Circumstances()
    state = model.problem.lot.state
    steady = (around.reach or reach_of(state)).temperature is None
    terms = [t for name in unseen if (t := _term(model, name)) is not None and t.effect.typical_ug[1] > floor]
    terms = [t for t in terms if not (steady and "temperature" in drivers_of_term(state, t))]
    if not terms:
        return None
    rivals = rivals_of(model, [], model.terms)
    proposed = ProposalSearch(Sighting(rivals, terms), around, already).best()
    return None if proposed is None else replace(proposed, pair=())


def _has_angles(model: Model) -> bool:
    """Whether the table angles are known, as for every proposal."""
    state = model.problem.lot.state
    return state.outer is not None and state.inner is not None and not model.problem.lot.radial


def _term(model: Model, name: str) -> Term | None:
    """The term of an effect at the middle of its grid; None if a required quantity was not recorded."""
    effect, state = catalogue.get(name), model.problem.lot.state
    try:
        grid = resting_grid(effect, state)
        model.problem.columns(effect, grid[0])
    except MissingInput:
        return None
    return Term(effect, tuple(grid[len(grid) // 2].items()))


def _all_kinds_of_steps(state: State, reach: TableReach, pace: StationPace) -> list[SequenceStep]:
    """Steps of every kind that a station can take: directions, temperatures, waits, approaches, ramps, power."""
    here = present(state, pace)
    poses = pose_grid(reach, here)
    steps = poses[::_EVERY]
    for temperature in temperatures(here, reach):
        steps += pose_grid(reach, temperature)[::_FURTHER]
    kinds: set[str] = set()
    for course in courses(state, reach, poses[:4], here):
        if course.kind not in kinds:
            kinds.add(course.kind)
            steps += course.steps
    return steps


def _never_apart(rivals: Rivals, around: Circumstances) -> Flags:
    """Flags (r, r): whether the rival of a column explains the prediction of that of a row under every step of the station."""
    state = rivals.lot.state
    steps = _all_kinds_of_steps(state, around.reach or reach_of(state), around.pace)
    if not steps:
        return ~np.eye(len(rivals.terms), dtype=bool)
    separation = apart(rivals, steps, around.pace)
    same = separation.left < NOTHING * np.maximum(separation.whole, 1e-300)[:, None]
    np.fill_diagonal(same, val=False)
    return same
