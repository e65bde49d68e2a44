"""Error of every unit on poses that the fit has not used, against the limit."""

from pipelines.report.context import ReportContext
from pipelines.report.interactive import figure_of
from pipelines.report.run_pictures import lot_chart
from pipelines.report.templates import fill

ORDER = 40
TITLE = "Verification on poses not used by the fit"
TEMPLATE = """\
{{ plot | safe }}
<p class="note">Blue: mean over the dwells of a pose, to which the limit (dashed) applies; red: beyond it. Grey: single dwells, with the wander of the device.</p>
"""


def render(report: ReportContext) -> str | None:
    """One plot of the lot; None without verification poses."""
    if not len(report.tables["verification"]):
        return None
    units, limit = [unit.unit for unit in report.calibrated], report.limit("verification_norm_ug")
    return fill(
        TEMPLATE,
        plot=figure_of(lot_chart(report.tables["verification"], report.tables["verification_poses"], units, limit)),
    )
