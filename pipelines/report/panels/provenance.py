"""Run, capture, station, libraries and code that the numbers come from."""

from pipelines.report.context import ReportContext
from pipelines.report.templates import fill

ORDER = 80
TITLE = "Provenance"
TEMPLATE = """\
<table>
{% for name, value in lines %}<tr><td>{{ name }}</td><td>{{ value }}</td></tr>
{% endfor %}
</table>
"""


def render(report: ReportContext) -> str:
    """The provenance of the run as a table."""
    run, about = report.run, report.about
    manifests = [run.manifest(name) for name in run.tables()]
    code = {manifest["stage"]: manifest["code"][:12] for manifest in manifests}
    lines = [
        ("run", run.id),
        ("capture", str(about.get("capture"))),
        ("started", f"{about['when'][:19].replace('T', ' ')} UTC by {about['who']} on {about['where']}"),
        ("station", f"{about['station']['name']} ({about['station']['kind']})"),
        ("libraries", ", ".join(f"{name} {version}" for name, version in about["libraries"].items())),
        ("code", ", ".join(f"{stage} {short}" for stage, short in code.items() if short)),
    ]
    return fill(TEMPLATE, lines=lines)
