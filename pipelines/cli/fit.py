"""``tumbleline fit``: archived data again, with another model or other limits."""

import shlex
from pathlib import Path
from typing import Any, NoReturn

from pipelines.archive import Archive, Run
from pipelines.cli import options
from pipelines.cli.printing import conclude, error_console, remark, say
from pipelines.cli.text.verdict_text import judged, print_verdict_of_fit
from pipelines.stages.figures import plain_reason
from schemas.errors import WrongUse
from schemas.foreign import shown

PART = "Old data, new models"
ORDER = 510
SUMMARY = "Fit archived data again, with another model or other limits."
EXAMPLES = (
    "tumbleline fit latest --effects bias,scale,misalignment,third_order",
    "tumbleline fit latest --limits industrial",
)


def command(
    run: options.RunArgument = "latest",
    effects: options.OtherEffectsOption = "",
    model: options.ModelOption = None,
    limits: options.OtherLimitsOption = "",
    leave_out: options.LeaveOutOption = "",
    effect_file: options.EffectFileOption = None,
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Fit a model to archived data again; the result is a new run on the same measurement; the old run is kept.

    An import is fitted with known poses or, without them, by the norm of gravity. Exit status 1: the model is not adequate, it
    cannot be judged, or a unit did not pass.
    """
    from pipelines.chain.runner import Runner
    from pipelines.cli.inputs import add_effects
    from pipelines.cli.summary import all_passed, print_result, summary
    from pipelines.jobs.job import job_of_run

    if Path(run).is_file():
        quoted = shlex.quote(run) if run.isprintable() else shown(run)  # a line to paste is not shortened
        raise WrongUse(
            f"fit: '{shown(run)}' is a file, a run of the archive is needed; 'tumbleline compare {quoted}' fits dwells in a "
            "file, 'tumbleline import' brings a recording into the archive"
        )
    store = Archive(archive)
    stored = store.run(run)
    if not stored.about.get("capture"):
        _fit_import(stored, (effects, model, limits, effect_file), leave_out, as_json=as_json)
    if leave_out:
        raise WrongUse(f"run {stored.id}: --leave-out is for imports, this run was captured; measure the dwell again")
    add_effects(effect_file)
    listed = [name.strip() for name in effects.split(",")] if effects else []
    job = job_of_run(store.run(run), effects=listed, model=model, limits=limits)
    runner = Runner(job, store)
    try:
        for done in runner.all():
            remark(f"{done.stage:<9} {'was there' if done.reused else f'{done.seconds:.1f} s'}")
    except Exception:
        runner.abandon()  # the measurements are the old run's: nothing is lost, and no empty run becomes the latest
        raise
    document = judged(summary(runner.run), runner.run)
    conclude(document, print_result, as_json=as_json, passed=all_passed(document))


def _fit_import(
    run: Run, change: tuple[str, Path | None, str, list[Path] | None], leave_out: str, *, as_json: bool
) -> NoReturn:
    """Fit a model to an import, keep it as a run of its own and print it.

    change : effects, model file, limits and files with effects; empty or None if not given
    """
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.imported_fit import fit_document
    from pipelines.rerun.rerun import again
    from pipelines.tables.leave_out import named_dwells

    store = Archive(run.archive.root)
    with error_console().status("fitting and judging"):
        outcome = again(store, run.id, change_from_options(*change, where="fit"), left_out=named_dwells(leave_out))
        document = fit_document(store.run(outcome.new), run.id)
    passed = document["adequate"] is True and all(unit["outcome"] == "pass" for unit in document["units"])
    conclude(document, _print_imported, as_json=as_json, passed=passed)


def _print_imported(document: dict[str, Any]) -> None:
    left = f", without {', '.join(document['left_out'])}" if document["left_out"] else ""
    model = ", ".join(document["effects"]) or "axes in the plane"
    say(f"{model}{left}: kept as run {document['run']}")
    for line in document["lines"]:
        say(f"  {line}")
    for unit in document["units"]:
        reasons = f" ({plain_reason(unit['reasons'])})" if unit["reasons"] else ""
        say(f"  {unit['unit']}: {unit['outcome']}, grade {unit['grade']}{reasons}")
    print_verdict_of_fit(document["adequate"], "this model does not describe these data", document["faulty"])
