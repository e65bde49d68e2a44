"""Whether the model of the run is adequate, with residual, noise and probability, and the next step."""

from inertial.uncertainty.rounding import chance
from pipelines.jobs.adequacy import adequacy_of
from pipelines.report.context import ReportContext
from pipelines.report.numbers import significant
from pipelines.report.templates import fill
from pipelines.tables.sound_lot import SMALL_MISFIT, is_small

ORDER = 25
TITLE = "Adequacy of the model"
TEMPLATE = """\
{% if verdict.adequate is none %}
<div class="verdict unjudged">Cannot be judged: {{ verdict.reason }}.</div>
{% elif verdict.adequate %}
<div class="verdict adequate">Adequate: the residuals are explained by the noise of the measurement.</div>
{% else %}
<div class="verdict inadequate">Not adequate: the residuals are not explained by the noise of the measurement{{ "; " ~ small if small }}.</div>
{% endif %}
{% if verdict.rms_ug is not none %}
<div class="cards">
  <div class="card"><b>{{ number(verdict.rms_ug) }} µg</b><span>residual of the model, rms over {{ verdict.units }} unit{{ "s" if verdict.units != 1 }}</span></div>
  <div class="card"><b>{{ number(verdict.floor_ug) }} µg</b><span>noise of the measurement, rms</span></div>
  <div class="card"><b>{{ chance(verdict.p_value) }}</b><span>probability of the residual under noise alone</span></div>
</div>
{% endif %}
{% if verdict.faulty %}
<p>Left out because of a data fault: {{ verdict.faulty | join(", ") }}.</p>
{% endif %}
{% if verdict.adequate %}
<p>No effect has to be added. <code>tumbleline diagnose {{ run }}</code> lists the effects that this plan cannot show.</p>
{% elif verdict.adequate is none %}
<p>Next step: remove this cause, then measure again; <code>tumbleline diagnose {{ run }}</code> judges the run again, also with another model (<code>--effects</code>).</p>
{% else %}
<p>Next step: <code>tumbleline diagnose {{ run }}</code> names the missing effects or the faulty dwells. The figures and coefficients below are those of the model as it is.</p>
{% endif %}
"""


def render(report: ReportContext) -> str | None:
    """The verdict, three figures and the next step; None without a multi-position test."""
    verdict = adequacy_of(report.run)
    if verdict is None:
        return None
    small = SMALL_MISFIT if verdict["adequate"] is False and is_small(verdict) else ""
    return fill(TEMPLATE, verdict=verdict, small=small, run=report.run.id, number=significant, chance=chance)
