"""``tumbleline improve``: diagnose a model, add the effects that are missing, and judge them by a fresh run, in one command."""

from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive, Run
from pipelines.cli import options
from pipelines.cli.options import argument, names_in, option
from pipelines.cli.printing import conclude, error_console, refuse_standard_output, remark, say
from pipelines.improvement.improvement import Attendant, ImprovedTables, Improvement
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    import pandas as pd

    from pipelines.diagnosis.diagnose import Examination


PART = "Start here"
ORDER = 20
SUMMARY = "Diagnose a model, add what is missing, and judge it by a fresh run, in one command."
EXAMPLES = ("tumbleline improve latest", "tumbleline improve dwells.csv --model model.toml --fresh fresh.csv --yes")
CHOICES = "y or Enter adds it, n leaves it out; Ctrl-C stops, and nothing is written"
UNATTENDED = "improve: standard input ended before an answer, a line is needed; give --yes to run without an operator"


MEASURES = "y or Enter measures them, n leaves it; Ctrl-C stops, and the same command continues"


def command(
    sources: Annotated[
        list[str],
        argument(
            "DATA…|RUN",
            "A recording in any format that import reads, in one file or several; a table of dwells; or a run.",
        ),
    ],
    effects: options.EffectsOption = "",
    model: Annotated[
        Path | None, option("--model FILE", "Model file to judge; its next versions are written to it.")
    ] = None,
    output: Annotated[
        Path | None, option("--output -o FILE", "Model file to write; --model or model.toml by default.")
    ] = None,
    choose: Annotated[
        str,
        option("--effect a,b", "Effects to add without a question: one of each group that the data cannot separate."),
    ] = "",
    temperatures: options.TemperaturesOption = "",
    fresh: options.FreshOption = "",
    fresh_temperatures: options.FreshTemperaturesOption = "",
    leave_out: options.LeaveOutOption = "",
    who: options.WhoOption = "",
    effect_file: options.EffectFileOption = None,
    setting: Annotated[list[str] | None, options.set_option(options.READING)] = None,
    archive: options.ArchiveOption = None,
    *,
    yes: Annotated[
        bool,
        option(
            "--yes -y",
            "Answer every question with yes; of effects that the data cannot separate, name one with --effect.",
        ),
    ] = False,
    measure: Annotated[
        bool | None,
        option(
            "--measure/--no-measure",
            "Let the station of a run measure its units again as the fresh run; default: ask at a terminal.",
        ),
    ] = None,
    show_all: options.AllOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Diagnose a model, ask which of the missing effects to add, write the model file, and judge the change by a fresh run.

    A recording of another system is recognised, imported and fitted first; the import that was chosen is printed as a command.
    Several files are one recording of one sensor: they follow one another, or stand side by side with --set join=columns.
    Where a column or unit is not certain nothing is imported, and the command to complete is printed.

    One question per effect; effects that these data cannot separate are named in the question. Where DATA is a run and an effect
    was added, the fresh run is one of its archive, or the station measures it: one more question, or --measure. Exit status 0:
    the resulting model is adequate and no fresh run refutes it; 1: otherwise; 2: the input cannot be used.
    """
    from pipelines.cli.inputs import add_effects, both_runs, without_dwells
    from pipelines.cli.next_commands import Given, judged_data
    from pipelines.cli.terminal import attended
    from pipelines.cli.text.improve_text import next_lines, next_of_recording, print_improvement, print_recording
    from pipelines.diagnosis.inputs import file_beside, judged_effects
    from pipelines.importers import limited
    from pipelines.importers.files import is_file
    from pipelines.improvement.recording import bring_in

    reading = options.settings(setting, options.READING, "improve")
    add_effects(effect_file)
    target = _target(model, output)
    recording, data = None, sources[0]
    if runs := [source for source in sources if len(sources) > 1 and not is_file(source)]:
        raise WrongUse(
            f"improve: {len(sources)} sources, of which '{shown(runs[0])}' is no file; give one run, or files only"
        )
    if is_file(data):
        limited.start()
        recording = bring_in([Path(source) for source in sources], archive, error_console().status, **reading)
    data = data if recording is None else recording["run"]  # a table of dwells is read as it is
    yes = yes or (recording is not None and not attended())
    judged = judged_effects(data, archive, effects, model, "improve")
    dwells, history, again, again_history = both_runs(data, temperatures, fresh, fresh_temperatures, archive)
    dwells, _ = without_dwells(dwells, leave_out)
    tables = ImprovedTables(dwells, history, again, again_history)
    beside = temperatures or (file_beside(data, "history") if is_file(data) else "")
    may_measure = True if yes and measure is None else measure
    brief = recording is not None and not show_all
    attendant = _Terminal(data, model, archive, quiet=as_json or brief, measure=may_measure, show_all=show_all)
    improvement = Improvement(data, tables, model, target, beside, who, fresh, attendant)
    document = improvement.run(judged, list(names_in(choose)), yes=yes)
    given = Given(archive, fresh, fresh_temperatures, leave_out, effect_file or ())
    repeated = [*(["--output", str(output)] if output else []), *(["--who", who] if who else [])]
    document["next"] = next_lines(document, (model, target), partial(judged_data, data, beside, given), given, repeated)
    if recording is not None:
        document["recording"] = recording
        options_of_model = ["--model", str(model)] if model else []
        document["next"] = next_of_recording(document, recording, given, options_of_model, repeated)
    show = print_recording if brief else print_improvement
    conclude(document, show, as_json=as_json, passed=bool(document["adequate"] and not document["refuted"]))


class _Terminal(Attendant):
    """Shows an improvement at the terminal and asks its questions there.

    quiet : no diagnosis is printed · measure : whether the station measures a fresh run; None: it is asked
    show_all : a diagnosis is printed with its long tables
    """

    def __init__(
        self, data: str, model: Path | None, archive: str | None, *, quiet: bool, measure: bool | None, show_all: bool
    ) -> None:
        self._data, self._model, self._archive, self._quiet, self._measure = data, model, archive, quiet, measure
        self._all = show_all

    def working(self, what: str) -> AbstractContextManager[Any]:
        """A line that stands while something is computed."""
        return error_console().status(what)

    def begins_again(self, added: list[str]) -> None:
        """Prints the heading of the second diagnosis."""
        if not self._quiet:
            say(f"\nDiagnosis with {', '.join(added)}", style="bold cyan")

    def diagnosed(self, made: "Examination", *, first: bool) -> None:
        """Prints a diagnosis with its picture the first time, as its verdict alone later."""
        from pipelines.cli.text.diagnosis_text import print_diagnosis
        from pipelines.cli.text.verdict_text import print_verdict

        if self._quiet:
            return
        if first:
            print_diagnosis(made.document, made=made, data=None, model=self._model, brief=not self._all)
        else:
            print_verdict(made.document)

    def agrees(self, effect: str, others: list[str], target: Path) -> bool:
        """The answer of the operator, who is told what these data do not separate from the effect."""
        from pipelines.cli.terminal import agreed

        question = f"Add {effect} to {target}?"
        if others:
            listed = ", ".join(others)
            question = f"These data do not separate {effect} from {listed}. Add the first, {effect}, to {target}?"
        return agreed(question, CHOICES, UNATTENDED)

    def fresh_run(self) -> "tuple[str, pd.DataFrame, pd.DataFrame | None] | None":
        """A fresh run of the archive, or one that the station measures now."""
        from pipelines.cli.inputs import dwells_and_history

        name = fresh_run(self._data, self._archive, measure=self._measure)
        return (name, *dwells_and_history(name, "", self._archive)) if name else None


def _target(model: Path | None, output: Path | None) -> Path:
    """The model file to write; another existing file is refused."""
    from pipelines.cli.next_commands import free_name

    refuse_standard_output(output, "improve", "the model is written, then extended and judged from it")
    target = output or model or Path(free_name())
    if target != model and target.exists():
        raise WrongUse(
            f"improve: {target} exists and is not the model that is judged; give --model {target} to extend it, or another "
            "--output"
        )
    return target


def fresh_run(source: str, archive: str | None, *, measure: bool | None) -> str:
    """The fresh run of a run; empty where there is none and none is measured.

    source : a file or a run, as it was named
    measure : whether the station measures one where the archive has none; None: ask at the terminal, else not
    """
    from pipelines.importers.files import is_file
    from pipelines.jobs.fresh_run import fresh_run_of, repeatable

    if is_file(source):
        return ""
    store = Archive(archive)
    run = store.run(source)
    fresh = fresh_run_of(store, run)
    if fresh is not None:
        text = f"fresh run: {fresh.id}, the same units measured again"
        remark(text)
        return fresh.id
    if measure is False or not repeatable(run):
        return ""
    return _measured(store, run, ask=measure is None)


def _measured(store: Archive, run: Run, *, ask: bool) -> str:
    from pipelines.cli.terminal import agreed, attended
    from pipelines.jobs.fresh_run import fresh_repeat
    from pipelines.jobs.job import job_of_run, measured_again
    from pipelines.schedule.steps import steps
    from pipelines.schedule.timing import minutes

    if ask and not attended():
        return ""
    job = measured_again(job_of_run(run), fresh_repeat(store, run))
    time = minutes(steps(job.recipe), job.station, job.recipe).total
    question = (
        f"Measure the same {len(job.lot.units)} units again on station {job.station.name} as a fresh run "
        f"({time:.0f} min of station time)?"
    )
    if ask and not agreed(question, MEASURES):
        return ""
    from pipelines.cli.run import measured

    return measured(job, store, None, asks=attended() and job.station.kind == "modbus").id
