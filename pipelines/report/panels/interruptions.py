"""Pauses, door openings and repeated dwells of the run."""

from pipelines.capture.interruptions import interruptions
from pipelines.report.context import ReportContext
from pipelines.report.templates import fill

ORDER = 60
TITLE = "Interruptions at the station"
TEMPLATE = """\
{% if interruptions is none %}
<p class="note">The archive of this run has no record of interruptions.</p>
{% elif not interruptions.events %}
<p class="note">None: the door stayed closed, nothing paused the run, no dwell was measured again.</p>
{% else %}
<p>Pauses: {{ interruptions.pauses }}, {{ (interruptions.paused_s / 60) | round(1) }} min waited. Door opened: {{ interruptions.door_opened }}. Dwells measured again: {{ interruptions.repeated_dwells | length }}.</p>
{% if interruptions.repeated_dwells %}
<h3>Dwells measured again</h3>
<table>
<tr><th class="n">dwell</th><th>pose</th><th class="n">repetitions</th><th>reasons</th></tr>
{% for dwell in interruptions.repeated_dwells %}
<tr><td class="n">{{ dwell.record }}</td><td>{{ dwell.pose }}</td><td class="n">{{ dwell.times }}</td><td>{{ dwell.reasons | join("; ") }}</td></tr>
{% endfor %}
</table>
{% endif %}
<h3>Events in order of time</h3>
<table>
<tr><th class="n">time<br><small>min</small></th><th>event</th><th>dwell</th><th>reason</th><th>action</th></tr>
{% for event in interruptions.events %}
<tr><td class="n">{{ (event.time_s / 60) | round(1) }}</td><td>{{ event.kind | replace("_", " ") }}</td><td>{% if event.record >= 0 %}{{ event.record }} {{ event.pose }}{% endif %}</td><td>{{ event.reason }}</td><td>{{ event.action }}</td></tr>
{% endfor %}
</table>
<p class="note">Data measured during an event were discarded and measured again, or the unit was refused; the results above contain none of them.</p>
{% endif %}
"""


def render(report: ReportContext) -> str:
    """The interruptions in order of time, or one sentence where there are none."""
    return fill(TEMPLATE, interruptions=interruptions(report.run))
