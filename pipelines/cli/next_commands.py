"""Commands to give next, as lines that can be pasted: every file, run and archive in them exists, and every word is quoted."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pipelines.archive import Archive, Run
from pipelines.cli.printing import say
from pipelines.diagnosis.sentences import UNSEEN

PROGRAM = "tumbleline"
MEASURE_AGAIN = (
    "A second measurement of the same units tells an effect from a fault of this run: give it to history with "
    "--fresh{history}."
)


@dataclass(frozen=True)
class JudgedData:
    """The data that a command judged, as they were named on the command line.

    source : dwells, a file or a run · history : the file of temperatures against time that was read; empty where there was none
    fresh, fresh_history : the same units measured again; empty where no such data are known
    measure : the words of the command that measures ``fresh``; none where it is there
    refusal : why the recipe of a run cannot fit a model; None where the data are not from a recipe
    archive : as it was given; None for the default one
    """

    source: str
    history: str = ""
    fresh: str = ""
    fresh_history: str = ""
    archive: str | None = None
    measure: tuple[str, ...] = ()
    refusal: Callable[[Sequence[str]], str] | None = None

    @property
    def options(self) -> list[str]:
        """The options that name history and archive."""
        return [*(["--history", self.history] if self.history else []), *archive_words(self.archive)]


FindData = Callable[[], JudgedData]  # gives the data of a command; see :func:`judged_data`


def command_line(*words: str) -> str:
    """A command of this program as a line for a shell."""
    return shlex.join([PROGRAM, *words])


def archive_words(archive: str | None) -> list[str]:
    """The option that names an archive; none for the default one."""
    return ["--archive", str(archive)] if archive else []


def judged_data(source: str, history: str, archive: str | None) -> JudgedData:
    """The data of a command, with a fresh run: the one beside a file, or the one that an archive holds or will hold.

    history : the file of temperatures against time that was read; empty where there was none
    """
    from pipelines.diagnosis.inputs import file_beside
    from pipelines.importers.files import is_file

    if is_file(source):
        fresh = file_beside(source, "fresh")
        return JudgedData(source, history, fresh, file_beside(fresh, "history") if fresh and history else "", archive)
    from pipelines.chain.runner import decisive
    from pipelines.jobs.fresh_run import fresh_repeat, fresh_run_of, repeatable
    from pipelines.jobs.job import OF_RUN, job_of_run, measured_again

    store = Archive(archive)
    run = store.run(source)
    if not repeatable(run):
        return JudgedData(run.id, history, archive=archive)
    refusal = partial(fit_refusal, run)
    fresh_run = fresh_run_of(store, run)
    if fresh_run is not None:
        return JudgedData(run.id, history, fresh_run.id, archive=archive, refusal=refusal)
    repeat = fresh_repeat(store, run)
    job = measured_again(job_of_run(run), repeat)
    words = ("run", f"{OF_RUN}{run.id}", "--repeat", str(repeat), *archive_words(archive))
    fresh = store.run_name(job.recipe.name, decisive(job))
    return JudgedData(run.id, history, fresh, archive=archive, measure=words, refusal=refusal)


def extension(
    file: Path | str, effects: Sequence[str], judged: Sequence[str], data: JudgedData, *, new: bool
) -> list[str]:
    """The commands that add effects to a model file, and the one that shows the errors of its versions.

    judged : the model that was judged; a new file begins with it
    new : whether the file does not exist yet
    """
    start = ["--effects", ",".join(judged)] if new else []
    lines = [
        command_line("extend", str(file), name, *(start if place == 0 else []), "--run", data.source)
        for place, name in enumerate(effects)
    ]
    return [*lines, *fresh_measurement(file, data)]


def fresh_measurement(file: Path | str, data: JudgedData) -> list[str]:
    """The command that measures the units again, where that is possible and not done, and the one that shows the errors."""
    return [*([command_line(*data.measure)] if data.measure else []), versions(file, data)]


def versions(file: Path | str, data: JudgedData) -> str:
    """The command that shows the errors of the versions of a model."""
    fresh = ["--fresh", data.fresh] if data.fresh else []
    if data.fresh_history:
        fresh += ["--fresh-history", data.fresh_history]
    return command_line("history", str(file), "--dwells", data.source, *data.options, *fresh)


def print_next(lines: Sequence[str]) -> None:
    """Print commands under a heading."""
    if lines:
        say("\nNext:", "bold")
        for line in lines:
            say(f"  {line}")


def print_next_of_diagnosis(document: dict[str, Any], find: FindData, model: Path | None) -> None:
    """Print the commands after a diagnosis: the recipe that decides, and the effects that are added, or the formula to judge.

    find : gives the data; called only where there is something to do: to look for a fresh run takes a second
    model : the model file that was judged; None for a list of effects
    """
    steps = (row for row in document["next_measurements"] if row.get("measurable", True))
    decides = any(not row["why"].startswith(UNSEEN) for row in steps)
    if not (document["recommended"] or document["offer"] or decides):
        return
    data = find()
    lines: list[str] = []
    if decides and data.refusal is not None:  # dwells of a file do not state the recipe that they were measured with
        own = ["--model", str(model)] if model else ["--effects", ",".join(document["effects"])]
        lines.append(command_line("diagnose", data.source, *own, *data.options, "--next", free_name("next")))
    elif decides:
        say(
            "To write these steps as a recipe, add --next FILE.toml --recipe RECIPE, the recipe of these dwells.", "dim"
        )
    if document["recommended"]:
        lines += _extension(document, data, model)
    elif offer := document["offer"]:  # judges the model with the formula, without a model file
        words = ["--effects", ",".join([*document["effects"], offer["id"]])]
        words += ["--formula", f"{offer['id']}={'; '.join(offer['columns'])}", *data.options]
        lines.append(command_line("diagnose", data.source, *words))
    print_next(lines)


def print_extension(document: dict[str, Any], find: FindData, model: Path | None) -> None:
    """Print the commands that add the recommended effects of a diagnosis and judge them; see :func:`print_next_of_diagnosis`."""
    if document["recommended"]:
        print_next(_extension(document, find(), model))


def _extension(document: dict[str, Any], data: JudgedData, model: Path | None) -> list[str]:
    """The commands that add the recommended effects; what they lack is printed before them."""
    file = model or free_name()
    new = not (model and model.exists())
    if data.refusal is not None and (why := data.refusal([*document["effects"], *document["recommended"]])):
        say(why, "yellow")
    if not data.fresh:
        its_own = " and its temperatures with --fresh-history" if data.history else ""
        say(MEASURE_AGAIN.format(history=its_own), "dim")
    return extension(file, document["recommended"], document["effects"], data, new=new)


def free_name(stem: str = "model") -> str:
    """A name for a new file; an existing one belongs to another model or recipe."""
    names = (f"{stem}.toml", *(f"{stem}-{k}.toml" for k in range(2, 1000)))
    return next(name for name in names if not Path(name).exists())


def fit_refusal(run: Run, effects: Sequence[str]) -> str:
    """What a run's recipe lacks to fit a model, and why its dwells show the model none the less; empty where it lacks nothing."""
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
