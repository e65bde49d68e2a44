"""Commands to give next, as lines that can be pasted: every file, run and archive in them exists, and every word is quoted."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from pipelines.archive import Archive, Run
from pipelines.cli.printing import say
from pipelines.diagnosis.documents import DiagnosisDocument
from pipelines.diagnosis.sentences import UNSEEN

PROGRAM = "tumbleline"
MEASURE_AGAIN = (
    "A second measurement of the same units tells an effect from a fault of this run: give it to history with "
    "--fresh{history}."
)


@dataclass(frozen=True)
class Given:
    """Options of a command that the next ones need as well.

    archive : None for the default one · fresh, fresh_history, leave_out : as given, empty where not
    effect_files : Python files with effects · formulas : effects as formulas of the command line
    """

    archive: str | None = None
    fresh: str = ""
    fresh_history: str = ""
    leave_out: str = ""
    effect_files: Sequence[Path] = ()
    formulas: Sequence[str] = ()

    @property
    def effects(self) -> list[str]:
        """The options that name the files with effects."""
        return [word for path in self.effect_files for word in ("--effect-file", str(path))]

    @property
    def written(self) -> list[str]:
        """The options that write the formulas."""
        return [word for formula in self.formulas for word in ("--formula", formula)]


@dataclass(frozen=True)
class JudgedData:
    """The data that a command judged, as they were named on the command line.

    source : dwells, a file or a run · history : the file of temperatures against time that was read; empty where there was none
    fresh, fresh_history : the same units measured again; empty where no such data are known
    measure : the words of the command that measures ``fresh``; none where it is there
    refusal : why the recipe of a run cannot fit a model; None where the data are not from a recipe
    given : what else the command was given
    """

    source: str
    history: str = ""
    fresh: str = ""
    fresh_history: str = ""
    measure: tuple[str, ...] = ()
    refusal: Callable[[Sequence[str]], str] | None = None
    given: Given = field(default_factory=Given)

    @property
    def options(self) -> list[str]:
        """The options that name history, archive, effects of the user and dwells left out."""
        history = ["--temperatures", self.history] if self.history else []
        left = ["--leave-out", self.given.leave_out] if self.given.leave_out else []
        return [*history, *archive_words(self.given.archive), *self.given.effects, *left]

    @property
    def again(self) -> list[str]:
        """The options that name the fresh run and its temperatures."""
        history = ["--fresh-temperatures", self.fresh_history] if self.fresh_history else []
        return ["--fresh", self.fresh, *history] if self.fresh else []


FindData = Callable[[], JudgedData]  # gives the data of a command; see :func:`judged_data`


def command_line(*words: str) -> str:
    """A command of this program as a line for a shell."""
    return shlex.join([PROGRAM, *words])


def archive_words(archive: str | None) -> list[str]:
    """The option that names an archive; none for the default archive."""
    return ["--archive", str(archive)] if archive else []


def judged_data(source: str, history: str, given: Given) -> JudgedData:
    """The data of a command, with a fresh run: as given, beside a file, or the run that an archive holds or will hold.

    history : the file of temperatures against time that was read; empty where there was none
    """
    from pipelines.diagnosis.inputs import file_beside
    from pipelines.importers.files import is_file

    if is_file(source):
        fresh = given.fresh or file_beside(source, "fresh")
        beside = file_beside(fresh, "history") if fresh and history else ""
        return JudgedData(source, history, fresh, given.fresh_history or beside, given=given)
    from pipelines.chain.runner import decisive
    from pipelines.jobs.fresh_run import fresh_repeat, fresh_run_of, repeatable
    from pipelines.jobs.job import OF_RUN, job_of_run, measured_again

    store = Archive(given.archive)
    run = store.run(source)
    refusal = partial(fit_refusal, run) if repeatable(run) else None
    known = given.fresh or ("" if refusal is None or (found := fresh_run_of(store, run)) is None else found.id)
    if known or refusal is None:
        return JudgedData(run.id, history, known, given.fresh_history, refusal=refusal, given=given)
    repeat = fresh_repeat(store, run)
    job = measured_again(job_of_run(run), repeat)
    words = ("run", f"{OF_RUN}{run.id}", "--repeat", str(repeat), *archive_words(given.archive))
    fresh = store.run_name(job.recipe.name, decisive(job))
    return JudgedData(run.id, history, fresh, measure=words, refusal=refusal, given=given)


def extension(
    file: Path | str, effects: Sequence[str], judged: Sequence[str], data: JudgedData, *, new: bool
) -> list[str]:
    """The commands that add effects to a model file, and the command that shows the errors of its versions.

    judged : the model that was judged; a new file begins with it
    new : whether the file does not exist yet
    """
    start = ["--effects", ",".join(judged), *data.given.written] if new else []
    lines = [
        command_line(
            "extend", str(file), name, *(start if number == 0 else []), "--dwells", data.source, *data.given.effects
        )
        for number, name in enumerate(effects)
    ]
    return [*lines, *fresh_measurement(file, data)]


def fresh_measurement(file: Path | str, data: JudgedData) -> list[str]:
    """The command that measures the units again, where that is possible and not done, and the command that shows the errors."""
    return [*([command_line(*data.measure)] if data.measure else []), versions(file, data)]


def versions(file: Path | str, data: JudgedData) -> str:
    """The command that shows the errors of the versions of a model."""
    return command_line("history", str(file), "--dwells", data.source, *data.options, *data.again)


def print_next(lines: Sequence[str]) -> None:
    """Print commands under a heading."""
    if lines:
        say("\nNext:", "bold")
        for line in lines:
            say(f"  {line}")


def print_next_of_diagnosis(document: DiagnosisDocument, find: FindData, model: Path | None) -> None:
    """Print the commands after a diagnosis: the recipe that decides; the effects that are added, the suspect or formula to judge.

    find : gives the data; called only where there is something to do: to look for a fresh run takes a second
    model : the model file that was judged; None for a list of effects
    """
    steps = (row for row in document["next_measurements"] if row.get("measurable", True))
    decides = any(not row["why"].startswith(UNSEEN) for row in steps)
    suspected = document["suspected"]
    if not (document["recommended"] or document["offer"] or suspected or decides):
        return
    data = find()
    lines: list[str] = []
    model_option = ["--model", str(model)] if model else ["--effects", ",".join(document["effects"])]
    if decides and data.refusal is not None:  # dwells of a file do not state the recipe that they were measured with
        lines.append(command_line("diagnose", data.source, *model_option, *data.options, "--output", free_name("next")))
    elif decides:
        say(
            "To write these steps as a recipe, add --output FILE.toml --recipe RECIPE, the recipe of these dwells.",
            "dim",
        )
    if document["recommended"]:
        lines += _extension(document, data, model)
    elif suspected:
        added = ["--effect", suspected["effects"][0]]
        lines.append(command_line("improve", data.source, *model_option, *data.options, *data.again, *added))
    elif offer := document["offer"]:  # judges the model with the formula, without a model file
        words = ["--effects", ",".join([*document["effects"], offer["id"]])]
        words += ["--formula", f"{offer['id']}={'; '.join(offer['columns'])}", *data.given.written, *data.options]
        lines.append(command_line("diagnose", data.source, *words))
    print_next(lines)


def print_extension(document: DiagnosisDocument, find: FindData, model: Path | None) -> None:
    """Print the commands that add the recommended effects of a diagnosis and judge them; see :func:`print_next_of_diagnosis`."""
    if document["recommended"]:
        print_next(_extension(document, find(), model))


def _extension(document: DiagnosisDocument, data: JudgedData, model: Path | None) -> list[str]:
    """The commands that add the recommended effects; what they lack is printed before them."""
    file = model or free_name()
    new = not (model and model.exists())
    if data.refusal is not None and (why := data.refusal([*document["effects"], *document["recommended"]])):
        say(why, "yellow")
    if not data.fresh:
        its_own = " and its temperatures with --fresh-temperatures" if data.history else ""
        say(MEASURE_AGAIN.format(history=its_own), "dim")
    return extension(file, document["recommended"], document["effects"], data, new=new)


def free_name(stem: str = "model") -> str:
    """A name for a new file; an existing one belongs to another model or recipe."""
    names = (f"{stem}.toml", *(f"{stem}-{k}.toml" for k in range(2, 1000)))
    return next(name for name in names if not Path(name).exists())


def fit_refusal(run: Run, effects: Sequence[str]) -> str:
    """Why the recipe of a run cannot fit a model that its dwells show; empty where it can."""
    from pipelines.jobs.job import job_of_run
    from pipelines.planning.context import with_verification_hint
    from pipelines.planning.plan import missing
    from pipelines.schedule.planned_state import state_of
    from pipelines.schedule.steps import steps
    from pipelines.schedule.timing import schedule

    job = job_of_run(run)
    recipe = job.recipe.model_copy(update={"effects": list(effects)})
    activities = schedule(steps(recipe), job.station, recipe)
    text = missing(state_of(activities, job.station, recipe, history=True), effects)
    if not text:
        return ""
    return (
        f"Recipe {recipe.name} cannot fit this model: {with_verification_hint(text, activities, job.station, recipe)}."
    )
