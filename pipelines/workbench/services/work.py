"""The work of jobs, in separate processes: each calls the functions of a command. Results can be pickled."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Mapping
from typing import Any

from pipelines.workbench.results import Diagnosed
from schemas.errors import TumblelineError
from schemas.installed import not_installed

ReportProgress = Callable[[int, int, str], None]


def done_in_process(kind: str, request: Mapping[str, Any], report_progress: ReportProgress) -> tuple[str, Any]:
    """The result of a request: ``done`` with the result, or ``failed`` with a sentence."""
    from threadpoolctl import threadpool_limits

    from inertial import effects
    from inertial.errors import InertialError

    try:
        with threadpool_limits(1), effects.additions_forgotten():
            return "done", WORK[kind](request, report_progress)
    except (TumblelineError, InertialError) as problem:
        return "failed", str(problem)
    except Exception as problem:  # noqa: BLE001 - a defect: the page says so, the details go to the server's log
        traceback.print_exc()
        defect = f"a defect of the program ({type(problem).__name__}: {problem}); the server's log has the details"
        return "failed", not_installed(problem) or defect


def _inputs(request: Mapping[str, Any], where: str) -> tuple[Any, Any, list[str] | None]:
    """Dwells, history and the model of a request."""
    from pipelines.diagnosis.inputs import dwells_and_history, judged_effects, use_written_formulas
    from pipelines.tables.leave_out import leave_out, named_dwells

    use_written_formulas(request["formula"], where)
    listed = ",".join(request["effects"])
    judged = judged_effects(request["source"], request["archive"], listed, None, where)
    table, history, _ = dwells_and_history(request["source"], "", request["archive"])
    return leave_out(table, named_dwells(",".join(request["without"]))), history, judged


def diagnose(request: Mapping[str, Any], report_progress: ReportProgress) -> Diagnosed:
    """The diagnosis of a source against a model; and the residuals of the model before it."""
    steps = 4
    report_progress(0, steps, "reading the dwells")
    from inertial.quantities import formula_names
    from pipelines.diagnosis.diagnose import default_model
    from pipelines.diagnosis.examination import examination
    from pipelines.report.residual_table import ladder_of, residual_table, residuals_with
    from pipelines.tables.condense import condense
    from pipelines.tables.dwell_table import covariates

    dwells, history, judged = _inputs(request, "diagnose")
    added = list(request["added"])
    model = [*(judged or default_model(dwells)), *added]
    report_progress(1, steps, "searching for missing effects")
    made = examination(dwells, history, model, request["without"])
    faulty = {unit for fault in made.document["blocked_by"] for unit in fault["units"]}
    units = tuple(unit for unit in made.measured.units if unit not in faulty)
    table, ladder, before = None, [], None
    if made.diagnosis is not None:
        report_progress(2, steps, "computing the residuals")
        table, ladder = residual_table(made.measured, made.diagnosis, units), ladder_of(made.diagnosis)
        if added:
            report_progress(3, steps, "fitting the model before the last step")
            before = residuals_with(condense(dwells), history, model[:-1], units)
    state = made.measured.state
    known = {name: one for name, one in formula_names().items() if getattr(state, one[0]) is not None}
    names = {name: meaning for name, (_, _, meaning) in known.items() if not meaning.startswith("the same")}
    names |= dict.fromkeys(covariates(dwells), "recorded column")
    return Diagnosed(made.document, table, ladder, before, names)


def ladder(request: Mapping[str, Any], report_progress: ReportProgress) -> list[dict[str, Any]]:
    """The errors of every version of a model: fitted, cross-validated, on a fresh run, and the floor."""
    from contextlib import nullcontext
    from itertools import count

    from pipelines.diagnosis.diagnose import default_model
    from pipelines.diagnosis.inputs import dwells_and_history
    from pipelines.improvement.improvement import ImprovedTables, errors_by_version
    from pipelines.jobs.model_files import Version

    dwells, history, judged = _inputs(request, "compare")
    start = tuple(judged or default_model(dwells))
    fresh, fresh_history = None, None
    if request["fresh"]:
        fresh, fresh_history, _ = dwells_and_history(request["fresh"], "", request["archive"])
    added = list(request["added"])
    versions = [
        Version(k + 1, (*start, *added[:k]), tuple(added[k - 1 : k]) if k else (), (), None)
        for k in range(len(added) + 1)
    ]
    fitted = count()

    def working() -> nullcontext[None]:
        done = next(fitted)
        report_progress(done, len(versions), f"fitting version {done + 1}")
        return nullcontext()

    return errors_by_version(versions, ImprovedTables(dwells, history, fresh, fresh_history), working)


def plan(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The plan of a recipe, and the data of its charts."""
    report_progress(0, 2, "reading the recipe")
    from pipelines.workbench.views.planned import planned

    report_progress(1, 2, "visibility of effects")
    return planned(request)


def what_if(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The effect of a model on the lots of the archive; kept there as evidence for its release."""
    from pathlib import Path

    from pipelines.archive import Archive
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.selection import selected
    from pipelines.rerun.whatif import evaluated

    steps = iter(range(3))
    change, archive = change_from_options("", Path(request["model"]), where="what if"), Archive(request["archive"])
    runs = [entry.id for entry in selected(archive, ["all"])]
    return evaluated(archive, runs, change, report_progress=lambda text: report_progress(next(steps), 3, text))


def audit(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The audit of the archive, and the data of its charts."""
    report_progress(0, 2, "reading the runs")
    from pipelines.workbench.views.audited import audited

    return audited(request, report_progress)


def bring_in(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The import of an uploaded file."""
    report_progress(0, 2, "reading the file")
    from pipelines.workbench.services.uploads import imported

    report_progress(1, 2, "importing")
    return imported(request)


WORK: dict[str, Any] = {
    "diagnose": diagnose,
    "ladder": ladder,
    "plan": plan,
    "audit": audit,
    "whatif": what_if,
    "import": bring_in,
}
