"""Recipe, device and date of the run, its yield, poses, temperatures and limits."""

from pipelines.report.context import ReportContext
from pipelines.report.templates import fill

ORDER = 10
TITLE = ""
TEMPLATE = """\
<h1>Calibration report: {{ recipe.name }}</h1>
<p class="lead">{{ about.lot.device }} · {{ units }} units · {{ about.when[:16] | replace("T", " ") }} UTC · run {{ run }}</p>

<div class="cards">
  <div class="card"><b>{{ passed }} of {{ units }}</b><span>passed, yield {{ (100 * passed / units) | round | int }} %</span></div>
{% if tumbles %}  <div class="card"><b>{{ recipe.poses | length }} + {{ verification_poses }}</b><span>poses for fit + verification</span></div>
{% endif %}{% if procedures %}  <div class="card"><b>{{ procedures | length }}</b><span>procedures: {{ procedures | join(", ") }}</span></div>
{% endif %}  <div class="card"><b>{{ recipe.temperatures_C | map("int") | join(" / ") | replace("-", "−") }} °C</b><span>soaked {{ (recipe.soak_min_s / 60) | round | int }} min or longer each</span></div>
  <div class="card"><b>{{ about.limits.name }}</b><span>limits applied</span></div>
</div>
"""


def render(report: ReportContext) -> str:
    """The heading of the page and four cards."""
    return fill(
        TEMPLATE,
        run=report.run.id,
        about=report.about,
        recipe=report.recipe,
        tumbles=bool(report.recipe["poses"]),
        procedures=[str(part["kind"]).replace("_", " ") for part in report.recipe.get("procedures", [])],
        units=len(report.units),
        passed=sum(unit.outcome == "pass" for unit in report.units),
        verification_poses=len({pose["name"] for pose in report.recipe["verification"]}),
    )
