"""The model of a page, saved as the next version of a model file, with the reason."""

import getpass
import re
import threading
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from inertial import effects
from pipelines.diagnosis.inputs import use_written_formulas, with_formulas
from pipelines.improvement.improvement import with_effects
from pipelines.jobs.model_files import ModelStep, model_text, new_model, publish_model
from pipelines.jobs.releases import Release
from pipelines.jobs.releases import release as publish
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import WrongUse, did_you_mean

FOLDER = "models"
NAME = re.compile(r"[a-z0-9][a-z0-9_-]{0,60}")
_ALONE = threading.Lock()


def models(settings: WorkbenchSettings) -> list[str]:
    """Names of the existing model files."""
    folder = settings.folder / FOLDER
    return sorted(path.stem for path in folder.glob("*.toml")) if folder.is_dir() else []


def path_of(settings: WorkbenchSettings, name: str) -> Path:
    """The file of a model.

    Raises
    ------
    WrongUse
        There is none of this name.
    """
    known = models(settings)
    if name not in known:
        raise WrongUse(f"model: no file is called '{name[:60]}'; {did_you_mean(name, known)}")
    return settings.folder / FOLDER / f"{name}.toml"


def release(settings: WorkbenchSettings, name: str, since: str, device: str, station: str, reason: str) -> Release:
    """A model released to the line from a day on; only one whose what-if says "better".

    Raises
    ------
    WrongUse
        There is no such model, no evidence, no reason, or the day is no date.
    """
    from pipelines.archive import Archive
    from pipelines.jobs.model_change import change_from_options
    from pipelines.rerun.selection import moment

    with _ALONE, effects.additions_forgotten():
        change = change_from_options("", path_of(settings, name), where="release")
        archive = Archive(settings.archive)
        return publish(archive, change, moment(since, "release"), device=device, station=station, reason=reason)


def save(
    settings: WorkbenchSettings,
    name: str,
    start: Sequence[str],
    added: Sequence[str],
    formulas: Sequence[str],
    why: str,
    source: str,
) -> tuple[Path, int]:
    """The file and its last version: each effect of ``added`` that the model lacks makes a further version.

    Parameters
    ----------
    start : the model that a new file begins with · formulas : ``id = expression`` of the formulas that are used
    why, source : the reason, and the dwells with the evidence

    Raises
    ------
    WrongUse
        The name or the reason is missing, or there is no change to save.
    """
    if not NAME.fullmatch(name):
        raise WrongUse(
            f"model: name '{name[:60]}', lower-case letters, digits, - and _ are needed; write one such as line-1"
        )
    if not why.strip():
        raise WrongUse("model: no reason is given, one sentence is needed; write why the effect is added")
    path = settings.folder / FOLDER / f"{name}.toml"
    by, at = getpass.getuser(), datetime.now(UTC).replace(microsecond=0)
    with _ALONE, effects.additions_forgotten():
        use_written_formulas(formulas, "model")
        text = model_text(path) if path.is_file() else new_model(path, list(start), by, at)
        text = with_formulas(text, formulas, [*start, *added])
        lacking = [effect for effect in dict.fromkeys(added) if f'"{effect}"' not in text.partition("[[change]]")[0]]
        steps = [ModelStep(effect, by, at, why.strip(), source) for effect in lacking]
        text, after = with_effects(text, steps, path)
        if after is None and path.is_file():
            raise WrongUse(f"model: {path} has these effects already; nothing was written")
        if after is not None and (differs := {*after.model.effects} ^ {*start, *added}):
            raise WrongUse(
                f"model: with this step {path} has other effects than were judged on this page ({', '.join(sorted(differs))}); "
                "give another name, or begin with the model of this file"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        publish_model(path, text)
    return path, after.model.version if after else 1
