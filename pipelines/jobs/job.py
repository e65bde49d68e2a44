"""A job: recipe, limits, lot and station together, and the names that follow from them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

from inertial.errors import InertialError
from pipelines.archive import Archive, Run
from pipelines.archive.keys import digest
from pipelines.jobs.model_files import model_keys, read_model, refuse_unknown_effects, use_formulas
from pipelines.jobs.priors import stored_family, stored_in
from pipelines.jobs.recipes import MAIN_JOB, folder_of, load_limits, load_recipe, lot_of, units_of
from pipelines.jobs.terms import (
    budget_terms,
    refuse_beyond_station,
    refuse_contradictions,
    refuse_missing_full,
    refuse_other_outputs,
    refuse_unreachable,
    refuse_unusable_stop,
    with_stability,
)
from pipelines.procedures import refuse_unusable
from pipelines.schedule.planned_state import refuse_unidentified
from pipelines.stages.figures import UNITS
from pipelines.stages.grade import refuse_limits_without_figures
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.tables.dwell_table import covariates
from schemas.errors import RecipeInvalid, WrongUse
from schemas.fault import parse_fault
from schemas.limits import Limits, limits_of
from schemas.lot import Lot
from schemas.own_files import Kind, contents
from schemas.prior import StoredFamily
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station, with_faults
from stations.profile_files import recorded_columns

ANALYSIS_KEYS = {
    "name",
    "description",
    "effects",
    "formulas",
    "limits",
    "units",
    "seed",
    "zero_output",
    "model_name",
    "model_version",
    "uncertainty",  # states what is known, and drives nothing; so do the next two
    "stability",
    "certificate",
    "prior",
    "faults",  # they are the station's, which is in the capture's name
}


DECIDING = {"effects", "formulas", "zero_output", "uncertainty", "stability", "certificate"}
"""Of these keys what ``[stop]`` decides by: with it they are measured by, as are the limits, the whole station and the prior."""

OF_RUN = "run:"  # what a recipe's name begins with where it is the run whose units are measured again
GUARDS = {"suspenders", "safety", "self_test"}
"""Parts of a station that say when a capture pauses and how it ends: one that an operator has eased goes on where it was."""


@dataclass(frozen=True)
class Job:
    """All that decides a run's result, except the code.

    ``captured`` names the capture of a lot that was measured before, by a version that may have named captures otherwise.
    ``parents`` are the runs whose measurements this one goes on with, on the same station from where it stands.
    ``prior`` is the family of the devices where the recipe asks for a prior, as it was when the job was made; ``full`` the job
    with the full plan, which goes on where a unit does not fit that family.
    """

    recipe: Recipe
    limits: Limits
    lot: Lot
    station: StationConfig
    captured: str = ""
    parents: tuple[str, ...] = ()
    prior: StoredFamily | None = None
    full: "Job | None" = None

    def __post_init__(self) -> None:
        """Formulas of the model are effects wherever this job is worked on."""
        use_formulas(self.recipe.formulas, f"recipe {self.recipe.name}")

    @property
    def terms(self) -> BudgetTerms:
        """The statements from which the uncertainty budget is computed."""
        return budget_terms(self.recipe, self.station, self.limits)

    @property
    def capture_id(self) -> str:
        """Name of the capture; recipes that differ only in the analysis of the data share it."""
        if self.captured:
            return self.captured
        unmoved, decided = {*GUARDS}, dict[str, Any]()
        if self.recipe.stop is None:
            measured = self.recipe.model_dump(mode="json", exclude=ANALYSIS_KEYS)
            unmoved |= {"pace", "reference", "uncertainty"}  # plan time, state standards: they drive nothing
        else:
            measured = self.recipe.model_dump(mode="json", exclude=ANALYSIS_KEYS - DECIDING)
            decided = {"limits": self.limits.model_dump(mode="json"), "prior": self._prior_but_its_age}
        if not measured["soaks"]:  # recipes without them keep the names that their captures had before there were any
            del measured["soaks"]
        if not self.recipe.procedures:
            unmoved.add("equipment")
        station = self.station.model_dump(mode="json", exclude=unmoved)
        after = {"parents": list(self.parents)} if self.parents else {}
        files = {"own_files": hashes} if (hashes := self.own_files) else {}
        content = {"recipe": measured, "lot": self.lot.model_dump(), "station": station, **after, **files, **decided}
        return digest(content)[:16]

    @property
    def _prior_but_its_age(self) -> dict[str, Any] | None:
        """The prior without what widens as time passes, so that a capture which was killed is gone on with."""
        return (
            None
            if self.prior is None
            else self.prior.model_dump(exclude={"own": {"__all__": {"covariance"}}, "groups": True})
        )

    @cached_property  # read when the job is made: later edits of a file do not change the run
    def own_files(self) -> dict[str, str]:
        """SHA-256 of the user's profiles and preset that the station and the lot name: they decide what is measured."""
        devices = self.station.devices
        fitted = [devices.outer, devices.inner, devices.chamber, devices.reader, devices.slots]
        if self.recipe.procedures:
            fitted += self.station.fitted().values()
        named: list[tuple[Kind, str]] = [("profiles", device.profile) for device in fitted]
        if self.station.simulation is not None:
            named.append(("presets", self.lot.device))
        return contents(named)

    @property
    def about(self) -> dict[str, Any]:
        """The content of ``run.json`` that describes the run to readers."""
        return {
            "recipe": self.recipe.model_dump(mode="json"),
            "limits": self.limits.model_dump(mode="json"),
            "lot": self.lot.model_dump(mode="json"),
            "station": self.station.model_dump(mode="json"),
            "capture": self.capture_id,
            **({"parents": list(self.parents)} if self.parents else {}),
            **({"prior": self.prior.model_dump()} if self.prior is not None else {}),
            **({"own_files": hashes} if not self.captured and (hashes := self.own_files) else {}),
        }


@dataclass(frozen=True)
class Request:
    """The plain values from which a command or a schedule makes a job.

    ``slots`` say where each of the ``units`` sits; slot by slot from 0 where there are none. ``faults`` are trouble for a
    simulated station, written as on the command line.
    """

    recipe: str = MAIN_JOB
    station: Path | None = None
    units: tuple[str, ...] = ()
    slots: tuple[int, ...] = ()
    seed: int | None = None
    repeat: int = 0
    faults: tuple[str, ...] = ()

    def parameters(self) -> dict[str, Any]:
        """The request as JSON-able values."""
        lists = {name: list(getattr(self, name)) for name in ("units", "slots", "faults")}
        return {**asdict(self), "station": str(self.station) if self.station else None, **lists}

    def fillings(self, slots: int) -> list[Self]:
        """The request in portions that fit a fixture of so many slots; a slot map is a single filling."""
        if self.recipe.startswith(OF_RUN):
            return [self]
        named = self.units or tuple(units_of(self.recipe))
        if self.slots or len(named) <= slots:
            return [self]
        return [replace(self, units=units) for units in fillings(named, slots)]

    def job(self, archive: Archive | None = None) -> Job:
        """The job that is asked for, with everything refused that cannot work, before anything moves.

        archive : where the line's model is released, for recipes that ask for it; the default archive where None
        """
        if self.recipe.startswith(OF_RUN):
            return self._of_run(archive)
        recipe = load_recipe(self.recipe, lambda device: self._line_model(archive, device))
        refuse_missing_full(recipe, folder_of(self.recipe))
        limits = load_limits(recipe, folder_of(self.recipe))
        lot = lot_of(recipe, self.units, self.slots, seed=self.seed, repeat=self.repeat)
        station = with_faults(load_station(self.station), [*recipe.faults, *map(parse_fault, self.faults)])
        refuse_contradictions(recipe, station)
        job = Job(with_stability(recipe, station), limits, lot, station)
        _refuse_more_units_than_slots(job)
        _refuse_unknown_device(job)
        refuse_beyond_station(job.recipe, job.station)
        _refuse_inconsistent(job, recorded_columns(station.devices.reader))
        refuse_unreachable(job.recipe, job.station, job.limits)
        refuse_unusable_stop(job.recipe, job.station, job.limits)
        serials = {unit.serial for unit in lot.units}
        family = stored_family(recipe, archive or Archive(), serials, station.kind)
        return replace(job, prior=family, full=self._full(recipe, archive))

    def _full(self, recipe: Recipe, archive: Archive | None) -> Job | None:
        """The job of the full plan that ``[prior]`` of a recipe names; None where it names none."""
        if recipe.prior is None or not recipe.prior.full:
            return None
        beside = folder_of(self.recipe) / recipe.prior.full
        full = replace(self, recipe=str(beside) if beside.is_file() else recipe.prior.full).job(archive)
        if full.recipe.prior is not None or full.recipe.device.lower() != recipe.device.lower():
            raise RecipeInvalid(
                f"recipe {recipe.name}: key 'prior.full': {full.recipe.name} measures {full.recipe.device} "
                f"{'with' if full.recipe.prior else 'without'} a prior, the same device without one is needed; name another",
                key="prior.full",
            )
        return full

    def _of_run(self, archive: Archive | None) -> Job:
        """The job of an archived run: its recipe, station and units, with this request's count of repeats."""
        options = {"--station": self.station, "--units": self.units, "--fault": self.faults}
        given = [*(name for name, value in options.items() if value), *(["--seed"] if self.seed is not None else [])]
        if given:
            raise WrongUse(
                f"run: {self.recipe} measures the units of a run again on its station, {', '.join(given)} cannot change them; "
                "leave it out, or name a recipe"
            )
        return measured_again(job_of_run((archive or Archive()).run(self.recipe.removeprefix(OF_RUN))), self.repeat)

    def _line_model(self, archive: Archive | None, device: str) -> dict[str, Any]:
        from pipelines.jobs.releases import line_model

        return line_model(archive or Archive(), device, load_station(self.station).name)


def job_of_run(run: Run, *, effects: Sequence[str] = (), model: Path | None = None, limits: str = "") -> Job:
    """The job of an archived run, with another model or other limits where they are given."""
    about = run.about
    if not about.get("capture"):
        raise WrongUse(
            f"run {run.id}: its data were imported, a captured run is needed; fit them with 'tumbleline rerun {run.id} "
            "--effects a,b,c', or at import with --fit"
        )
    if about.get("parents"):
        raise WrongUse(
            f"run {run.id}: it measured what run {about['parents'][0]} lacked, and has too few poses for a model of its own; "
            f"name run {about['parents'][0]}"
        )
    recipe = Recipe.model_validate(about["recipe"])
    if effects and model is not None:
        raise WrongUse("fit: --effects and --model are both given, one is needed; leave one out")
    if model is not None:
        recipe = recipe.model_copy(update=model_keys(read_model(model)))
    if effects or model is not None:
        use_formulas(recipe.formulas, f"run {run.id}")
        # the prior of another model does not fit this model
        recipe = recipe.model_copy(update={"effects": list(effects or recipe.effects), "prior": None})
        refuse_unknown_effects(recipe.effects, "fit")
    chosen = limits_of(about["limits"], UNITS)
    if limits:
        recipe = recipe.model_copy(update={"limits": limits})
        chosen = load_limits(recipe)
    station = StationConfig.model_validate(about["station"])
    prior = stored_in(about) if recipe.prior is not None else None
    job = Job(recipe, chosen, Lot.model_validate(about["lot"]), station, captured=about["capture"], prior=prior)
    known = "readings" in run.tables()
    _refuse_inconsistent(job, covariates(run.table("readings")) if known else recorded_columns(station.devices.reader))
    return job


def measured_again(job: Job, repeat: int) -> Job:
    """The job of an archived run with another count of repeats: a separate measurement."""
    if repeat == job.lot.repeat:
        return job
    return replace(job, lot=job.lot.model_copy(update={"repeat": repeat}), captured="")


def _refuse_inconsistent(job: Job, recorded: Sequence[str]) -> None:
    """Refuse a model that the plan cannot determine, or whose columns are not recorded, and limits that neither can serve."""
    refuse_limits_without_figures(job.limits, job.recipe)
    refuse_unusable(job.recipe, job.station)
    if not job.recipe.tumbles:
        return
    try:
        refuse_unidentified(job.recipe, recorded)
    except InertialError as problem:
        raise RecipeInvalid(str(problem), key="effects") from None


def _refuse_more_units_than_slots(job: Job) -> None:
    """Refuse a lot that does not fit the fixture: units must be seated between two fillings, so each filling is a lot."""
    serials, slots = [unit.serial for unit in job.lot.units], job.station.devices.slots.count
    if len(serials) > slots:
        lots = fillings(serials, slots)
        commands = ", then ".join(f"--units {','.join(serials)}" for serials in lots)
        raise WrongUse(
            f"lot: {len(serials)} units, the fixture has {slots} slots; measure {len(lots)} lots, one after the other: "
            f"{commands}"
        )
    for unit in job.lot.units:
        if unit.slot >= slots:
            raise WrongUse(
                f"lot: unit {unit.serial} in slot {unit.slot}, the fixture of station {job.station.name} has slots 0 to "
                f"{slots - 1}; correct the slot map"
            )


def fillings(serials: Sequence[str], slots: int) -> list[tuple[str, ...]]:
    """Serial numbers in portions that fit a fixture of so many slots."""
    return [tuple(serials[start : start + slots]) for start in range(0, len(serials), slots)]


def _refuse_unknown_device(job: Job) -> None:
    """Refuse devices and faults that a simulated station does not know."""
    refuse_other_outputs(job.recipe, job.station)
    if job.station.simulation is not None:
        from stations.plant.faults.catalogue import build_fault  # a station of hardware has no plant

        for fault in job.station.simulation.faults:
            build_fault(fault, [unit.serial for unit in job.lot.units])
