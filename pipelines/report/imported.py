"""The report of an import that was fitted: verdict with pictures, coefficients, figures against limits, certificates, budget."""

from collections.abc import Mapping

from inertial.quantities import ANGLE_COLUMNS, FORCE_COLUMNS
from pipelines.archive import Run
from pipelines.certificates.ledger import stated
from pipelines.certificates.validity import Calibration
from pipelines.diagnosis.diagnose import examination
from pipelines.jobs.model_files import use_formulas_of
from pipelines.report import keep_report
from pipelines.report.context import ReportContext
from pipelines.report.diagnosis import render_diagnosis
from pipelines.report.panels import budget, certificates
from pipelines.report.templates import fill
from pipelines.report.unit_panels import figures
from pipelines.stages.unknown_poses.budget import OF_POSES
from pipelines.stages.unknown_poses.fit import fitted_dwells
from pipelines.tables.frames import rows_of
from schemas.errors import WrongUse

GRADED = ("grades", "figures", "budget", "uncertainties", "verification", "lot_risks")
FEWEST_OF_A_LOT = 3
"""Units from which on the risk of a lot is known."""
OF_ENCODERS = ("orthogonality", "outer_offset", "inner_offset", "harmonics")
TEMPLATE = """\
<h2>{{ certificates_title }}</h2>
{{ certificates | safe }}
{% for unit, outcome, grade, reasons, figures in units %}
<h2>{{ unit }}: {{ outcome }}, grade {{ grade }}</h2>
{% for reason in reasons %}<p>{{ reason }}</p>{% endfor %}
{{ figures | safe }}
{% endfor %}
{% if held_out %}<p class="note">{{ held_out }} dwells were held out of the fit; errors "on poses not used" are theirs.
{% if norm %}Without known poses only the component along the force shows in | |a| − g |: the error of an axis is that of the
magnitude, weighted by how far the force points along the axis.{% endif %}</p>{% endif %}
<h2>{{ budget_title }}</h2>
{{ budget | safe }}
"""


class ImportContext(ReportContext):
    """An import that was graded, as the panels of a report read it."""

    def __init__(self, run: Run, certificates: Mapping[str, Calibration]) -> None:
        super().__init__(run, certificates)
        if self.tables["grades"]["unit"].nunique() < FEWEST_OF_A_LOT:
            self.tables.pop("lot_risks", None)
        columns = set(run.table("dwells").columns)
        if not columns & {ANGLE_COLUMNS[0], FORCE_COLUMNS[0]}:
            self.not_needed = OF_POSES
        elif ANGLE_COLUMNS[0] not in columns:
            self.not_needed = OF_ENCODERS


def certificates_of(run: Run) -> dict[str, Calibration]:
    """The certificates of the units of an import; none where it has no grades."""
    return stated(run, run.table("grades")["unit"]) if "grades" in run.tables() else {}


def decisions(run: Run) -> str:
    """The part of the page as HTML; empty where the import was not graded."""
    if not {"grades", "figures"} <= set(run.tables()):
        return ""
    report = ImportContext(run, certificates_of(run))
    return fill(
        TEMPLATE,
        certificates_title=certificates.TITLE,
        certificates=certificates.render(report),
        units=[(u.unit, u.outcome, u.grade, u.reasons, figures.render(u)) for u in report.units],
        norm=report.not_needed == OF_POSES,
        held_out=len(run.table("verification")) if "verification" in run.tables() else 0,
        budget_title=budget.TITLE,
        budget=budget.render(report),
    )


def make_imported_report(run: Run) -> bool:
    """Write the report of an import if it is missing or older than its tables; return whether it was up to date.

    Raises
    ------
    WrongUse
        The run has no coefficients, or none of a model of the catalogue.
    """
    effects = list((run.about.get("recipe") or {}).get("effects", ()))
    names = ("dwells", "coefficients")
    if axis := run.about.get("plane_across"):
        raise WrongUse(
            f"report: run {run.id} was turned about {axis} alone and has coefficients of the axes in the plane only; "
            f"'tumbleline fit {run.id}' prints them"
        )
    if not effects or not set(names) <= set(run.tables()):
        raise WrongUse(
            f"report: run {run.id} was imported and not fitted, coefficients are needed; fit it with 'tumbleline fit {run.id} "
            "--effects bias,scale,misalignment' then give this command for the new run"
        )
    use_formulas_of(run)
    judged = [name for name in GRADED if name in run.tables()]

    def page() -> str:
        past = run.table("history") if "history" in run.tables() else None
        made = examination(fitted_dwells(run.table("dwells")), past, effects)
        rows = rows_of(run.table("coefficients"))
        text = render_diagnosis(made, f"run {run.id}", rows)
        return text.replace("</body>", f"{decisions(run)}</body>")

    return keep_report(run, "report of an import", [*names, *judged], {"effects": effects}, certificates_of(run), page)
