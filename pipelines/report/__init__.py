"""The report for people: one HTML file per run that opens without a network."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pipelines.archive import Run, code_hash, stage_key
from pipelines.certificates.ledger import stated
from pipelines.certificates.validity import Calibration
from pipelines.report.context import OPTIONAL, TABLES, ReportContext
from pipelines.report.interactive import interactive as with_scripts
from pipelines.report.panel import rendered
from pipelines.report.templates import page_hash, template
from schemas.errors import WrongUse

__all__ = ["TABLES", "keep_report", "make_report", "render", "renew_report"]

PANELS = "pipelines.report.panels"


def render(run: Run, certificates: Mapping[str, Calibration] | None = None) -> str:
    """The report of a run as one HTML text that needs no other file, of the panels that are found.

    Parameters
    ----------
    certificates : of the run's units, in their present state in the ledger.
    """
    panels = rendered(PANELS, ReportContext(run, certificates or {}))
    return with_scripts(template("page.html").render(run=run.id, panels=panels))


def make_report(run: Run) -> bool:
    """Write the report of a run if it is missing or older than its tables; return whether it was up to date.

    Raises
    ------
    WrongUse
        The run is not finished, or an import without coefficients of a model of the catalogue.
    """
    if not _captured(run):
        from pipelines.report.imported import make_imported_report  # loads the search for effects

        return make_imported_report(run)
    if run.about.get("parents") and run.report.is_file():
        return True  # a follow-up has no decisions: its report is the diagnosis of all runs together
    missing = [name for name in TABLES if name not in run.tables()]
    if missing:
        raise WrongUse(
            f"report: run {run.id} has no {', '.join(missing)}; it is not finished: give its 'tumbleline run' again to continue"
        )
    names = [*TABLES, *(name for name in ("history", *OPTIONAL) if name in run.tables())]
    certificates = stated(run, run.table("grades")["unit"])
    parameters = {"page": page_hash()}  # the code's hash has no templates
    return keep_report(run, "report", names, parameters, certificates, lambda: render(run, certificates))


def renew_report(run: Run) -> None:
    """Write an existing report again after a change of the ledger."""
    if (run.path / "report.json").is_file() and (not _captured(run) or set(TABLES) <= set(run.tables())):
        make_report(run)


def _captured(run: Run) -> bool:
    """Whether the units of a run were measured on a station, not imported."""
    return bool(run.about.get("capture") or run.about.get("parents"))


def keep_report(
    run: Run,
    code_name: str,
    tables: Sequence[str],
    parameters: dict[str, Any],
    certificates: Mapping[str, Calibration],
    page: Callable[[], str],
) -> bool:
    """Write a report if it is missing or older than its tables; return whether it was up to date.

    Parameters
    ----------
    code_name : of the code that makes it · tables : that it is made from
    page : makes it as one HTML text
    """
    inputs, code = {name: run.manifest(name)["sha256"] for name in tables}, code_hash(code_name)
    if certificates:
        parameters = {
            **parameters,
            "certificates": {unit: calibration.key_values() for unit, calibration in sorted(certificates.items())},
        }
    key = stage_key("report", inputs, parameters, code)
    if run.has_report(key):
        run.seal()  # a killed writer may not have written it
        return True
    run.save_report(key, page(), {"inputs": inputs, "parameters": parameters, "code": code})
    return False
