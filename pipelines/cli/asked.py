"""What ``tumbleline plan optimise`` is asked, as a wish; what cannot be asked is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, get_args

from schemas.bounds import COLDEST_C, HOTTEST_C
from schemas.errors import WrongUse, did_you_mean
from schemas.units import MICRO

if TYPE_CHECKING:
    from pipelines.stages.plan import Planned
    from pipelines.stages.wish import Wish
    from schemas.recipe import Recipe


@dataclass(frozen=True)
class Asked:
    """The options of the command, as they were given."""

    see: str
    wanted: tuple[str, ...]
    factor: float
    temperatures: str
    poses: str
    criterion: str
    verification: int | None = None
    part: str = ""
    size: float | None = None
    separation: float | None = None

    @property
    def errors_named(self) -> bool:
        """Whether the errors wanted were given, rather than left at the textbook plan's."""
        return bool(self.wanted) or self.factor != 1.0


def wish_of(asked: Asked, base: Recipe, against: Planned, levels: tuple[float, ...]) -> Wish:
    """The wish of what was asked: errors as wanted, or rivals told apart."""
    return _parted(asked, against, levels) if _parts(asked) else _wish(asked, base, against, levels)


def levels_of(base: Recipe, temperatures: str) -> tuple[float, ...]:
    """Temperatures to meet, from the lowest."""
    try:
        given = [float(part) for part in temperatures.split(",")] if temperatures else base.temperatures_C
    except ValueError:
        message = f"plan: --temperatures '{temperatures}' is no list of numbers; write -10,25,60"
        raise WrongUse(message) from None
    outside = [level for level in given if not COLDEST_C <= level <= HOTTEST_C]
    if outside:
        found, needed = f"found {outside[0]:g} °C", f"{COLDEST_C:g} to {HOTTEST_C:g} °C is needed"
        message = f"plan: --temperatures '{temperatures}': {found}, {needed}; correct it"
        raise WrongUse(message)
    return tuple(sorted(set(given)))


def _parts(asked: Asked) -> bool:
    """Whether rivals are to be told apart; options of the one question beside the other are refused."""
    parts = asked.criterion.upper() == "T"
    other = (
        {"--wanted": asked.wanted, "--factor": asked.factor != 1.0}
        if parts
        else {"--part": asked.part, "--size": asked.size is not None, "--separation": asked.separation is not None}
    )
    for option, given in other.items():
        if given:
            message = f"plan: {option} does not go with --criterion {asked.criterion}; leave one of the two out" + (
                "" if parts else ", or write --criterion T"
            )
            raise WrongUse(message)
    return parts


def _parted(asked: Asked, against: Planned, levels: tuple[float, ...]) -> Wish:
    from pipelines.models import refuse_unknown_effects
    from pipelines.stages.rivals import ENOUGH, SIZE_UG, parted

    rivals, see = _names(asked.part), _names(asked.see)
    if not rivals:
        message = "plan: --criterion T needs the effects to tell apart; write --part third_order,odd_quadratic"
        raise WrongUse(message)
    refuse_unknown_effects(rivals, "plan: --part")
    refuse_unknown_effects(see, "plan: --see")
    _refuse_unknown_plan(asked.poses)
    return parted(
        against,
        rivals,
        levels,
        size_ug=asked.size or SIZE_UG,
        enough=asked.separation or ENOUGH,
        plan=asked.poses,
        see=see,
    )


def _names(listed: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(part.strip() for part in listed.split(",") if part.strip()))


def _refuse_unknown_plan(name: str) -> None:
    from inertial.poses import NAMED

    if name and name not in NAMED:
        message = f"plan: no plan of poses is called '{name}'; {did_you_mean(name, list(NAMED))}"
        raise WrongUse(message)


def _wish(asked: Asked, base: Recipe, against: Planned, levels: tuple[float, ...]) -> Wish:
    from inertial.design import local_names, split
    from inertial.exchange import Criterion
    from pipelines.models import refuse_unknown_effects
    from pipelines.stages.textbook import reference_errors, seen_by
    from pipelines.stages.wish import Wish, between, candidates

    criteria = {name.lower(): name for name in get_args(Criterion)}
    if asked.criterion.lower() not in criteria:
        known = [*get_args(Criterion), "T"]
        message = f"plan: no criterion '{asked.criterion}'; {did_you_mean(asked.criterion, known)}"
        raise WrongUse(message)
    _refuse_unknown_plan(asked.poses)
    see = _names(asked.see)
    refuse_unknown_effects(see, "plan: --see")
    errors = asked.factor * reference_errors(against, base)
    names = [name for name, _ in local_names(split(base.effects)[0], 0)]
    for effect, limit in _limits(asked.wanted, names).items():
        for column, name in enumerate(names):
            if name == effect:
                errors[:, column] = limit / MICRO
    return Wish(
        wanted=errors,
        see=see or seen_by(against, levels),
        levels=levels if asked.temperatures else (levels[0], levels[-1]),
        legal=() if asked.temperatures else between(levels),
        candidates=candidates(against.station, asked.poses),
        criterion=criteria[asked.criterion.lower()],
    )


def _limits(wanted: tuple[str, ...], model: list[str]) -> dict[str, float]:
    """Largest errors by effect, µg per unit of the column."""
    limits: dict[str, float] = {}
    for text in wanted:
        effect, _, number = text.partition("=")
        try:
            limits[effect] = float(number)
        except ValueError:
            limits[effect] = 0.0
        if effect not in model:
            message = f"plan: --wanted '{text}': '{effect}' is not in the model; {did_you_mean(effect, model)}"
            raise WrongUse(message)
        if not limits[effect] > 0.0:
            message = f"plan: --wanted '{text}': a positive error in µg is needed; write {effect}=50"
            raise WrongUse(message)
    return limits
