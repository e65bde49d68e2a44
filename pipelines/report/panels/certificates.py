"""Certificates of the run's units, as they are in the ledger."""

from pipelines.report.context import ReportContext
from pipelines.report.templates import fill

ORDER = 30
TITLE = "Certificates"
TEMPLATE = """\
{% if units | selectattr("certificate") | list %}
<table>
<tr><th>unit</th><th>certificate</th><th>valid from</th><th>until</th><th>state</th><th></th></tr>
{% for unit in units %}
<tr><td>{{ unit.unit }}</td>{% if unit.certificate %}<td>{{ unit.certificate.certificate }}</td><td>{{ unit.certificate.start }}</td><td>{{ unit.certificate.until }}</td>
<td>{% if unit.certificate.state == "revoked" %}<span class="tag fail">revoked</span>{% else %}{{ unit.certificate.state }}{% endif %}</td><td><small>{{ unit.certificate.reason }}</small></td>
{% else %}<td colspan="5"><small>not certified</small></td>{% endif %}</tr>
{% endfor %}
</table>
<p class="note">State of the ledger when this page was written; a certificate is valid from its first day until the day before "until". State today: tumbleline show UNIT --at DATE.</p>
{% else %}
<p class="note">No unit of this run had a certificate when this page was written: its coefficients have no period of validity (tumbleline certificate issue {{ run }}).</p>
{% endif %}
"""


def render(report: ReportContext) -> str:
    """One line per unit, or one sentence where no unit is certified."""
    return fill(TEMPLATE, units=report.units, run=report.run.id)
