"""The work of jobs, in separate processes: each calls the functions of a command. Results can be pickled."""

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipelines.archive import Archive
from pipelines.audit.finding import AuditFinding
from pipelines.diagnosis.documents import DiagnosisDocument, VersionDocument
from pipelines.drawing import Chart
from pipelines.report.effect_view import EffectView, effect_views
from pipelines.report.residual_table import ResidualTable, ladder_of, residual_table, residuals_with
from schemas.errors import TumblelineError
from schemas.installed import not_installed
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station

ReportProgress = Callable[[int, int, str], None]
MOST_CHARTS = 6
MOST_EVIDENCE = 80  # findings that have a chart


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis for its page.

    before : residuals of the model before the last step, µg, as in ``table``; None if there is none
    views : the residual against the quantity of each missing effect; of the whole residual where none is missing
    names : quantities for formulas, with their meaning
    """

    document: DiagnosisDocument
    table: ResidualTable | None
    ladder: list[dict[str, Any]]
    before: NDArray[np.float64] | None
    names: dict[str, str]
    views: list[EffectView] = field(default_factory=list[EffectView])


def done_in_process(kind: str, request: Mapping[str, Any], report_progress: ReportProgress) -> tuple[str, Any]:
    """The result of a request: ``done`` with the result, or ``failed`` with a sentence."""
    from threadpoolctl import threadpool_limits

    from inertial import effects
    from inertial.errors import InertialError

    try:
        with threadpool_limits(1), effects.additions_forgotten():
            return "done", WORK[kind](request, report_progress)
    except (TumblelineError, InertialError) as problem:
        from pipelines.workbench.services.uploads import in_fields

        return "failed", in_fields(str(problem), kind)
    except BrokenPipeError:  # the server ended: nobody waits for the result
        raise
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
    from pipelines.diagnosis.diagnose import default_model, examination
    from pipelines.tables.condense import condense
    from pipelines.tables.dwell_table import covariates

    dwells, history, judged = _inputs(request, "diagnose")
    added = list(request["added"])
    model = [*(judged or default_model(dwells)), *added]
    report_progress(1, steps, "searching for missing effects")
    made = examination(dwells, history, model, request["without"])
    units, views = made.sound, list[EffectView]()
    table, ladder, before = None, [], None
    if made.diagnosis is not None:
        report_progress(2, steps, "computing the residuals")
        table, ladder = residual_table(made.measured, made.diagnosis, units), ladder_of(made.diagnosis)
        views = effect_views(made.diagnosis, units, added[-1] if added else "")
        if added:
            report_progress(3, steps, "fitting the model before the last step")
            before = residuals_with(condense(dwells), history, model[:-1], units)
    state = made.measured.state
    known = {name: quantity for name, quantity in formula_names().items() if getattr(state, quantity[0]) is not None}
    names = {name: meaning for name, (_, _, meaning) in known.items() if not meaning.startswith("the same")}
    names |= dict.fromkeys(covariates(dwells), "recorded column")
    return Diagnosed(made.document, table, ladder, before, names, views)


def coefficients(request: Mapping[str, Any], report_progress: ReportProgress) -> list[dict[str, Any]]:
    """The coefficients that differ between two models on the same dwells, as :func:`pipelines.rerun.diff.changed` has them."""
    from pipelines.rerun.diff import COEFFICIENT, changed
    from pipelines.stages.fit import fit_in_memory
    from pipelines.tables.dwells import LotTables
    from pipelines.tables.frames import rows_of

    tables: list[pd.DataFrame] = []
    for number, side in enumerate(request["both"]):
        report_progress(number, len(request["both"]), "fitting")
        dwells, history, judged = _inputs(side, "two models")
        told = {"kind": "dwell", "out_unit": "g"}  # what a file that lacks them means
        completed = dwells.assign(**{name: text for name, text in told.items() if name not in dwells})
        fitted, _, _ = fit_in_memory(LotTables(completed, history), [*(judged or ()), *side["added"]])
        tables.append(fitted["coefficients"])
    return rows_of(changed(tables[0], tables[1], COEFFICIENT, "standard_error"))


def ladder(request: Mapping[str, Any], report_progress: ReportProgress) -> list[VersionDocument]:
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
    last = [(), *((effect,) for effect in added)]
    versions = [Version(k + 1, (*start, *added[:k]), new, (), None) for k, new in enumerate(last)]
    fitted = count()

    def working() -> nullcontext[None]:
        done = next(fitted)
        report_progress(done, len(versions), f"fitting version {done + 1}")
        return nullcontext()

    return errors_by_version(versions, ImprovedTables(dwells, history, fresh, fresh_history), working)


def planned(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """``document``, ``charts`` and ``poses`` of a plan; ``before``: the effects of the recipe by name, where poses are moved."""
    report_progress(0, 2, "reading the recipe")
    from pipelines.planning.context import noise_of, plan_context
    from pipelines.planning.plan import plan
    from pipelines.report.plan import sphere_chart, temperature_chart

    report_progress(1, 2, "visibility of effects")
    as_it_stands, recipe, config = recipe_of(request)
    noise = noise_of(recipe, recipe.device, None, None)
    context = plan_context(recipe, config, noise)
    before = plan(plan_context(as_it_stands, config, noise)) if request["pose"] else None
    return {
        "document": plan(context),
        "before": None if before is None else {row["effect"]: row for row in before["effects"]},
        "minutes_before": None if before is None else before["minutes"]["total"],
        "charts": {"sphere": sphere_chart(context), "temperature": temperature_chart(context)},
        "poses": pose_rows(as_it_stands, recipe),
    }


def recipe_of(request: Mapping[str, Any]) -> tuple[Recipe, Recipe, StationConfig]:
    """The recipe of a request as it stands, the same with its moved poses, and the station.

    Raises
    ------
    TumblelineError
        The recipe, its model or a pose is invalid.
    """
    from pipelines.jobs.moved_poses import moves_of, with_moved_poses
    from pipelines.jobs.releases import planned_recipe

    config = load_station(Path(request["station"]) if request["station"] else None)
    recipe = planned_recipe(request["recipe"], ",".join(request["effects"]), None, request["archive"], config.name)
    return recipe, with_moved_poses(recipe, moves_of(request["pose"], "plan"), "plan"), config


def pose_rows(as_it_stands: Recipe, recipe: Recipe) -> list[dict[str, Any]]:
    """Every pose once: name, use, angles in degrees, and whether it was moved."""
    rows: dict[str, dict[str, Any]] = {}
    for use in ("poses", "verification"):
        for old, new in zip(getattr(as_it_stands, use), getattr(recipe, use), strict=True):
            angles = {"outer_deg": new.outer_deg, "inner_deg": new.inner_deg}
            moved = (old.outer_deg, old.inner_deg) != (new.outer_deg, new.inner_deg)
            kind = "fit" if use == "poses" else "verification"
            rows[new.name] = {"name": new.name, "use": kind, **angles, "moved": moved}
    return list(rows.values())


def what_if(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The effect of a model on the lots of the archive; stored there as evidence for its release."""
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.selection import selected
    from pipelines.rerun.whatif import evaluated

    steps = iter(range(3))
    change, archive = change_from_options("", Path(request["model"]), where="what if"), Archive(request["archive"])
    runs = [entry.id for entry in selected(archive, ["all"])]
    return evaluated(archive, runs, change, report_progress=lambda text: report_progress(next(steps), 3, text))


def audited(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The document of an audit of the archive, its charts, and the address of every finding with the chart of its evidence."""
    report_progress(0, 2, "reading the runs")
    from pipelines.audit import pictures
    from pipelines.audit.audit import audit, refuse_nothing, scope_of
    from pipelines.audit.document import document, furthest
    from pipelines.audit.findings import findings
    from pipelines.audit.rules import load_rules

    scope = scope_of(*(str(request[name]) for name in ("since", "until", "device", "station")))
    archive_audit = audit(Archive(request["archive"]), load_rules(None), scope)
    report_progress(1, 2, "the evidence of its findings")
    refuse_nothing(archive_audit, str(request["archive"]))
    charts: dict[str, Chart] = {}
    months = [share for share in archive_audit.yields if share.of == "month"]
    if months:
        charts["yield"] = pictures.yield_chart(months)
    if archive_audit.due.row.size:
        charts["due"] = pictures.due_chart(archive_audit)
    plainest = sorted(archive_audit.charts, key=lambda chart: chart.p_value)[:MOST_CHARTS]
    moved = sorted((*archive_audit.stations, *archive_audit.slots), key=lambda series: -len(series.changes))[
        :MOST_CHARTS
    ]
    charts |= {f"control-{number}": pictures.control_chart(chart) for number, chart in enumerate(plainest)}
    charts |= {f"station-{number}": pictures.series_chart(series) for number, series in enumerate(moved)}
    drifts = enumerate(furthest(archive_audit, MOST_CHARTS))
    charts |= {f"drift-{number}": pictures.drift_chart(archive_audit, drift) for number, drift in drifts}
    listed = findings(archive_audit)
    evidence = {
        address_of(finding): pictures.evidence_chart(archive_audit, finding) for finding in listed[:MOST_EVIDENCE]
    }
    return {
        "document": document(archive_audit, listed, request["archive"]),
        "charts": charts,
        "evidence": {name: chart for name, chart in evidence.items() if chart is not None},
        "addresses": [address_of(finding) for finding in listed],
    }


def discovered(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The document of a search over all lots, and its charts."""
    report_progress(0, 2, "scoring new runs")
    from pipelines.discovery import page
    from pipelines.discovery.discover import Look
    from pipelines.discovery.discover import discovered as looked_at
    from pipelines.discovery.sentences import texts_of

    looked = looked_at(Archive(request["archive"]), Look(device=str(request["device"])))
    report_progress(1, 2, "drawing")
    document = looked.document
    texts = {row["id"]: texts_of(row) for row in (*document["discoveries"], *document["unexplained"])}
    return {"document": document, "charts": page.charts_of(looked.found, document), "texts": texts}


def address_of(finding: AuditFinding) -> str:
    """A name of a finding that does not change while the finding remains."""
    words = (finding.kind, finding.subject, str(finding.evidence.get("parameter", finding.evidence.get("figure", ""))))
    return ".".join(word for word in words if word)[:180]


def bring_in(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """The import of an uploaded file."""
    report_progress(0, 2, "reading the file")
    from pipelines.workbench.services.uploads import imported

    report_progress(1, 2, "importing")
    return imported(request)


WORK: dict[str, Any] = {
    "diagnose": diagnose,
    "ladder": ladder,
    "coefficients": coefficients,
    "plan": planned,
    "audit": audited,
    "discover": discovered,
    "whatif": what_if,
    "import": bring_in,
}
