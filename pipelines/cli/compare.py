"""``tumbleline compare``: a model against the dwells it is fitted to, dwells left out, and a fresh run."""

from pipelines.cli import options
from pipelines.cli.printing import error_console, give, print_table, say, short, short_values, warn
from pipelines.diagnosis.documents import ComparisonDocument, StationParameter

PART = "Is the model good enough, and what is missing?"
ORDER = 240
SUMMARY = "Compare a model with dwells, and with a fresh run of the same units."
EXAMPLES = (
    "tumbleline compare latest --model model.toml",
    "tumbleline compare dwells.csv --effects bias,scale,misalignment --fresh fresh.csv",
)

POSES = 6


def command(
    dwells: options.DwellsArgument,
    effects: options.EffectsOption = "",
    model: options.ModelOption = None,
    fresh: options.FreshOption = "",
    temperatures: options.TemperaturesOption = "",
    fresh_temperatures: options.FreshTemperaturesOption = "",
    effect_file: options.EffectFileOption = None,
    formula: options.FormulaOption = None,
    leave_out: options.LeaveOutOption = "",
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Fit a model to dwells; state its error there, on dwells left out, and on a fresh run with the coefficients unchanged."""
    from pipelines.cli.inputs import add_effects, both_runs, start_reader, without_dwells

    start_reader(dwells, fresh)
    from pipelines.diagnosis.compare import compare
    from pipelines.diagnosis.diagnose import default_model
    from pipelines.diagnosis.inputs import judged_effects

    add_effects(effect_file, formula, "compare")
    chosen = judged_effects(dwells, archive, effects, model, "compare")
    first, history, again, again_history = both_runs(dwells, temperatures, fresh, fresh_temperatures, archive)
    table, _ = without_dwells(first, leave_out)
    with error_console().status("fitting"):
        document = compare(table, chosen or default_model(table), history, again, again_history)
    give(document, print_comparison, as_json=as_json)


def print_comparison(document: ComparisonDocument, poses: int = POSES) -> None:
    """Print a comparison for people, with so many of the worst poses."""
    say(f"model  {', '.join(document['effects'])}")
    lines = [
        ["fitted to these dwells", short(document["rms_ug"])],
        ["dwells left out: the worst of poses, soaks, stretches of time", short(document["heldout_rms_ug"])],
    ]
    if document["fresh_rms_ug"] is not None:
        lines.append(["fresh run, coefficients unchanged", short(document["fresh_rms_ug"])])
    lines.append(["noise assumed by this fit", short(document["floor_ug"])])
    print_table(["error", "rms\nµg"], lines)
    say(
        "The noise assumed by the fit includes what is missing from the model; 'tumbleline diagnose' states the noise of the "
        "measurement.",
        style="dim",
    )
    fresh = document["fresh_rms_ug"] is not None
    units = [
        [u, short(e["rms_ug"]), short(e["fresh_rms_ug"])][: 3 if fresh else 2] for u, e in document["by_unit"].items()
    ]
    print_table(["unit", "rms\nµg", "fresh\nµg"][: 3 if fresh else 2], units)
    worst = [
        [" ".join(f"{v:+.2f}" for v in p["force"]), str(p["dwells"]), short(p["rms_ug"])]
        for p in document["by_pose"][:poses]
    ]
    if worst:
        print_table(["force x y z\ng", "dwells", "rms\nµg"], worst, title="Worst poses")
    _parameters(document)
    warn(document["warnings"])


def _parameters(document: ComparisonDocument) -> None:
    """Nonlinear parameters and those of the station."""
    from inertial import effects

    lines = [
        [name, p.name, short_values(values[p.name]), _interval(document, name, p.name), p.unit]
        for name, values in document["nonlinear"].items()
        for p in effects.get(name).nonlinear
        if p.name in values
    ]
    lines += [
        [row["effect"], row["name"], short(1e6 * row["value"]), _around(row), "µrad or µg/g"]
        for row in document["station"]
    ]
    if lines:
        print_table(["effect", "parameter", "value", "68 % interval", "unit"], lines)


def _interval(document: ComparisonDocument, effect: str, parameter: str) -> str:
    """The interval of a nonlinear parameter; values that differ between the axes, or are chosen from a few, have none."""
    interval = document["nonlinear_interval"].get(effect, {}).get(parameter)
    return f"{short(interval[0])} to {short(interval[1])}" if interval else "not estimated"


def _around(row: StationParameter) -> str:
    low, high = (1e6 * (row["value"] + sign * row["standard_error"]) for sign in (-1.0, 1.0))
    return f"{short(low)} to {short(high)}"
