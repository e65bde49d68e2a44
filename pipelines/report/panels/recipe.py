"""Model, dwell, static record and local gravity of the recipe."""

from pipelines.report.context import ReportContext
from pipelines.report.templates import fill
from pipelines.schedule.early_end import dwell_words, early_end, early_end_sentence, told_sentences

ORDER = 70
TITLE = "Recipe"
TEMPLATE = """\
<table>
<tr><td>model</td><td>{% if recipe.model_name %}{{ recipe.model_name }} version {{ recipe.model_version }}: {% endif %}{{ recipe.effects | join(", ") }}</td></tr>
<tr><td>dwell</td><td>{{ dwell }} s at {{ recipe.rate_hz }} Hz after {{ recipe.settle_s }} s of settling</td></tr>
{% if end %}<tr><td>end</td><td>{{ end }}</td></tr>
{% endif %}<tr><td>static record</td><td>{% if recipe.static_record_s %}{{ (recipe.static_record_s / 60) | round(1) }} min at {{ recipe.static_temperature_C }} °C{% else %}none{% endif %}</td></tr>
<tr><td>local gravity</td><td>{{ recipe.local_gravity_m_s2 }} m/s²</td></tr>
</table>
"""


def render(report: ReportContext) -> str:
    """The recipe as a table, and how ``[stop]`` ended the run."""
    end = early_end(report.run)
    text = "" if end is None else "; ".join([early_end_sentence(end) or "as planned", *told_sentences(end)])
    dwell = "" if end is None else dwell_words(end)
    return fill(TEMPLATE, recipe=report.recipe, end=text, dwell=dwell or report.recipe.get("dwell_s", ""))
