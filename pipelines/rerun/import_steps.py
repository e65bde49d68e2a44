"""The stages of the chain for a run of imported dwells, as far as what was imported with them allows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pandas as pd

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.archive import Run, code_hash
from pipelines.archive.keys import digest
from pipelines.chain.chain import BY_NAME, Tables
from pipelines.importers.mapping import OUTPUT_UNITS
from pipelines.importers.plane import plane_answer
from pipelines.jobs.model_files import effect_file_hashes
from pipelines.stages.fit import fit
from pipelines.stages.grade import GradeEvidence, grade
from pipelines.stages.judge import judge
from pipelines.stages.uncertainty.budget import budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.unknown_poses.budget import norm_budget
from pipelines.stages.unknown_poses.fit import fit_of_norms, fitted_dwells
from pipelines.stages.unknown_poses.verify import verify_norms
from pipelines.stages.verify import verify
from pipelines.tables.frames import empty_table
from pipelines.tables.leave_out import Dwells, leave_out
from schemas.limits import Limits
from schemas.units import STANDARD_GRAVITY_M_S2


@dataclass(frozen=True)
class StageCall:
    """One stage for one run: as :class:`pipelines.chain.chain.Stage`, with everything that the job decides filled in."""

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    parameters: dict[str, Any]
    code: str
    call: Callable[[Run], Tables]


@dataclass(frozen=True)
class ImportedData:
    """The properties of imported data that decide on the stages.

    history : whether temperatures between the dwells were; known : whether the poses are known, otherwise only the norm of
    gravity is; gravity : where it was measured, g
    """

    history: bool
    known: bool
    gravity: float

    def past(self, run: Run) -> pd.DataFrame | None:
        """The temperatures between the dwells of a run; None where it has none."""
        return run.table("history") if self.history else None

    def read(self, *names: str) -> tuple[str, ...]:
        """Tables that a stage reads: the dwells, the temperatures between them where there are any, and others."""
        return ("dwells", *(("history",) if self.history else ()), *names)


def imported(run: Run, dwells: pd.DataFrame) -> ImportedData:
    """The properties of the data of an imported run."""
    return ImportedData("history" in run.tables(), has_poses(dwells), gravity_of_import(run.about))


def has_poses(dwells: pd.DataFrame) -> bool:
    """Whether dwells have a reference, force or angles; otherwise only the norm of gravity is known."""
    return any(set(names) <= set(dwells.columns) for names in (FORCE_COLUMNS, ANGLE_COLUMNS))


def gravity_of_import(about: dict[str, Any]) -> float:
    """Gravity where an import was measured, g; the standard value where it was not given."""
    given = (about.get("mapping") or {}).get("local_gravity_m_s2")
    return 1.0 if given is None else float(given) / STANDARD_GRAVITY_M_S2


def zero_of_import(about: dict[str, Any]) -> float:
    """Nominal output at 0 g in the unit of the dwells; it was stated in the unit of the file."""
    mapping = about.get("mapping") or {}
    zero = float(mapping.get("zero_output", 0.0))
    return zero * OUTPUT_UNITS[mapping["units"]["output"]][1] if zero else 0.0


def _call(
    stage: str, inputs: tuple[str, ...], parameters: dict[str, Any], call: Callable[[Run], Tables], code: str = ""
) -> StageCall:
    """A call of a stage of the chain; ``code`` names its code where it is not that of the stage."""
    return StageCall(stage, inputs, BY_NAME[stage].outputs, *with_effect_files(code or stage, parameters), call)


def with_effect_files(result: str, parameters: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Parameters of a stage, with the hashes of the Python files (``--effect-file``) of its effects, and the hash of its code."""
    own = effect_file_hashes(parameters.get("effects", ()))
    if not own:
        return parameters, code_hash(result)
    return {**parameters, "effect_files": own}, digest([code_hash(result), *sorted(own.values())])


def import_step(data: ImportedData, left_out: Dwells, old: Run) -> StageCall:
    """The dwells as they were imported, or without those that are left out."""
    names = data.read()
    if not left_out:
        return StageCall("import", (), names, {}, "", lambda run: {name: run.table(name) for name in names})
    parameters = {"left_out": [list(pair) for pair in left_out], "dwells": old.manifest("dwells")["sha256"]}

    def call(_: Run) -> Tables:
        return {**{name: old.table(name) for name in names}, "dwells": leave_out(old.table("dwells"), left_out)}

    return StageCall("leave_out", (), names, parameters, "", call)


def fit_step(model: dict[str, Any], data: ImportedData) -> StageCall:
    """The fit of the chain; by the norm of gravity alone where the poses are not known."""

    def call(run: Run) -> Tables:
        read = run.table("dwells"), data.past(run), model["effects"]
        return fit(*read) if data.known else fit_of_norms(*read, data.gravity)

    more, code = ({}, "") if data.known else ({"gravity_g": data.gravity}, "fit of norms")
    parameters = {"effects": model["effects"], "formulas": model["formulas"], **more}
    return _call("fit", data.read(), parameters, call, code)


def plane_step(across: int, gravity: float) -> StageCall:
    """The fit of the two axes in the plane across an axis; gravity, g, is read where the poses are not known."""

    def call(run: Run) -> Tables:
        dwells = run.table("dwells")
        answer = plane_answer(dwells, across, gravity, str(dwells["out_unit"].iloc[0]))
        return {"coefficients": pd.DataFrame(answer.coefficients)}

    code = code_hash("fit in a plane")
    return StageCall("fit", ("dwells",), ("coefficients",), {"plane_across": across, "gravity_g": gravity}, code, call)


def judge_step(model: dict[str, Any], data: ImportedData) -> StageCall:
    """The verdict on the model; of dwells of unknown poses those that are held out are not judged."""
    parameters = {"effects": model["effects"], "formulas": model["formulas"], "known_poses": data.known}

    def call(run: Run) -> Tables:
        dwells = run.table("dwells")
        return judge(dwells if data.known else fitted_dwells(dwells), data.past(run), model["effects"])

    return _call("judge", data.read(), parameters, call)


def verify_step(data: ImportedData) -> StageCall:
    """Verification of a fit on the dwells that were held out; by the norm of gravity where the poses are not known."""
    fitted = ("coefficients", "covariance", "predictions" if data.known else "wander")

    def call(run: Run) -> Tables:
        coefficients, covariance, third = (run.table(name) for name in fitted)
        read = run.table("dwells"), data.past(run), coefficients, covariance, third
        return verify(*read) if data.known else verify_norms(*read, data.gravity)

    parameters, code = ({}, "") if data.known else ({"gravity_g": data.gravity}, "verify of norms")
    return _call("verify", data.read(*fitted), parameters, call, code)


def budget_step(terms: BudgetTerms, data: ImportedData) -> StageCall:
    """The uncertainty budget of an import whose references are stated."""
    names = ("coefficients", "covariance", "wander", "verification", "verification_poses")

    def call(run: Run) -> Tables:
        made = {name: run.table(name) for name in names}
        dwells, noise = run.table("dwells"), _no_noise()
        tables = BudgetTables(dwells, data.past(run), noise=noise, lot=None, calibration=None, **made)
        return budget(tables, terms) if data.known else norm_budget(tables, terms)

    return _call("budget", data.read(*names), terms.document(), call, "" if data.known else "budget of norms")


def grade_step(limits: Limits, zero: float, *, budgeted: bool) -> StageCall:
    """The grades of an import against limits; ``zero`` : nominal output at 0 g."""
    names = ("coefficients", "covariance", "residuals", "verification", "verification_poses")
    names = (*names, "uncertainties", "budget_covariance") if budgeted else names

    def call(run: Run) -> Tables:
        tables: dict[str, Any] = {name: run.table(name) for name in names}
        units = list(dict.fromkeys(tables["coefficients"]["unit"].astype(str)))
        sound = {"unit": units, "slot": range(len(units)), "refused": False, "fault": "", "reason": ""}
        return grade(GradeEvidence(verdicts=pd.DataFrame(sound), **tables, noise=_no_noise()), limits, zero)

    parameters = {"limits": limits.model_dump(mode="json"), **({"zero_output": zero} if zero else {})}
    return _call("grade", names, parameters, call)


def _no_noise() -> pd.DataFrame:
    """The table of noise terms of an import, which has no static record."""
    return empty_table(texts="unit axis term unit_text", numbers="value low high", flags="identified")
