"""The work that a page needs, from its state: a browser sends the address of a page, never a request itself."""

from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from inertial import effects
from pipelines.archive import Archive
from pipelines.archive.attributes import attribute_files
from pipelines.archive.keys import digest
from pipelines.importers.limited import in_reader
from pipelines.jobs.model_files import read_model
from pipelines.workbench.services import models, sources, uploads
from pipelines.workbench.services.work import recipe_of
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import (
    AuditPage,
    DiscoverPage,
    MissingPage,
    ModelsPage,
    PageState,
    PlanPage,
    TwoModelsPage,
    UploadPage,
)
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import is_file

Request = tuple[str, dict[str, Any]]


def of_address(settings: WorkbenchSettings, kind: str, path: str, query: Iterable[tuple[str, str]]) -> Request:
    """Title and request of a kind of work for the page of an address."""
    if kind not in KINDS or path != KINDS[kind][0].PATH:
        raise WrongUse(f"jobs: no page needs '{kind[:40]}'; {did_you_mean(kind, KINDS)}")
    state, problems = KINDS[kind][0].parse(query)
    if problems:
        raise WrongUse(problems[0])
    return KINDS[kind][1](settings, state)


def diagnosis(settings: WorkbenchSettings, page: MissingPage) -> Request:
    """A diagnosis."""
    return f"diagnosis of {page.source}", _judging(settings, page)


def ladder(settings: WorkbenchSettings, page: MissingPage) -> Request:
    """The errors of every version."""
    content = _judging(settings, page)
    fresh = sources.resolve(settings, page.fresh, "compare") if page.fresh else ""
    content |= {"fresh": fresh, "fresh_stamp": sources.stamp(settings, fresh) if fresh else ""}
    return f"errors on {page.source}", content


def _judging(settings: WorkbenchSettings, page: MissingPage) -> dict[str, Any]:
    page = settled(settings, page)
    name = page.source
    return {
        "archive": settings.archive, "source": name, "stamp": sources.stamp(settings, name), "effects": list(page.effects),
        "added": list(page.added), "without": list(page.without), "formula": list(page.formula),
    }  # fmt: skip


def two_models(settings: WorkbenchSettings, page: TwoModelsPage) -> tuple[MissingPage, MissingPage]:
    """Each model of the page as a diagnosis of the same dwells."""
    return _of_model(settings, page.source, page.first, ()), _of_model(settings, page.source, page.second, page.added)


def _of_model(settings: WorkbenchSettings, source: str, model: str, added: tuple[str, ...]) -> MissingPage:
    if not model:
        return settled(settings, MissingPage(source=source, added=added))
    file = read_model(models.path_of(settings, model))
    formulas = tuple(f"{formula.id} = {'; '.join(formula.columns)}" for formula in file.formula)
    return settled(
        settings, MissingPage(source=source, effects=tuple(file.model.effects), added=added, formula=formulas)
    )


def coefficients(settings: WorkbenchSettings, page: TwoModelsPage) -> Request:
    """The coefficients of two models on the same dwells."""
    both = [_judging(settings, model) for model in two_models(settings, page)]
    return f"coefficients of two models on {page.source}", {"both": both}


def settled(settings: WorkbenchSettings, page: MissingPage) -> MissingPage:
    """The page with the source's own name, and with the starting model if none is given."""
    name = sources.resolve(settings, page.source, "source")
    effects = page.effects or _starting_model(settings.archive, name, sources.stamp(settings, name))
    fresh = "" if page.fresh == name else page.fresh
    return page.model_copy(update={"source": name, "effects": effects, "fresh": fresh})


@lru_cache(maxsize=64)
def _starting_model(archive: str, name: str, stamp: str) -> tuple[str, ...]:
    """The default model of a diagnosis of these dwells; a file is read by the process of the reader, within its limits."""
    if is_file(name):
        return in_reader(uploads.LOOK, Path(name).name, default_model_of, archive, name)
    return default_model_of(archive, name)


def default_model_of(archive: str, name: str) -> tuple[str, ...]:
    """The default model of a diagnosis of dwells, by this process."""
    from pipelines.diagnosis.diagnose import default_model
    from pipelines.diagnosis.inputs import judged_effects
    from pipelines.importers.exchange import read_dwells

    with effects.additions_forgotten():
        judged = judged_effects(name, archive, "", None, "diagnose")
    return tuple(judged or default_model(read_dwells(name, archive=archive)))


def plan(settings: WorkbenchSettings, page: PlanPage) -> Request:
    """The plan of a recipe."""
    known = recipes(settings)
    if page.recipe not in known:
        raise WrongUse(f"plan: no recipe is called '{page.recipe[:60]}'; {did_you_mean(page.recipe, known)}")
    content: dict[str, Any] = {
        "archive": settings.archive, "recipe": page.recipe, "effects": list(page.effects), "pose": list(page.pose),
        "station": str(settings.station or ""),
    }  # fmt: skip
    with effects.additions_forgotten():
        parts = recipe_of(content)  # with the model of its file or of the line, which may change without the recipe
    return f"plan of {page.recipe}", content | {"stamp": digest([part.model_dump(mode="json") for part in parts])}


def what_if(settings: WorkbenchSettings, page: ModelsPage) -> Request:
    """The lots of the archive with a model beside their own."""
    path = models.path_of(settings, page.model)
    return f"what if {path.stem}", {
        "archive": settings.archive, "model": str(path), "stamp": path.stat().st_mtime_ns,
        "runs": sources.archive_stamp(settings),
    }  # fmt: skip


def audit(settings: WorkbenchSettings, page: AuditPage) -> Request:
    """The audit of the archive."""
    content = page.model_dump(include={"since", "until", "device", "station"})
    return "audit of the archive", content | {"archive": settings.archive, "stamp": sources.archive_stamp(settings)}


def discover(settings: WorkbenchSettings, page: DiscoverPage) -> Request:
    """What the lots of the archive show together."""
    return "discoveries in the archive", {
        "archive": settings.archive, "stamp": sources.archive_stamp(settings), "device": page.device,
        "attributes": len(attribute_files(Archive(settings.archive))),
    }  # fmt: skip


def bring_in(settings: WorkbenchSettings, page: UploadPage) -> Request:
    """The import of a file."""
    path = uploads.resolve(settings, page.file)
    content = page.model_dump(mode="json", exclude={"run"})
    return f"import of {path.name}", {**content, "archive": settings.archive}


def recipes(settings: WorkbenchSettings) -> list[str]:
    """Available recipes: the built-in one, and files of the workbench's folder."""
    names = [str(path) for path in sorted(settings.folder.glob("*.toml"))] if settings.folder.is_dir() else []
    return ["production", *(name for name in names if _is_recipe(Path(name)))]


def _is_recipe(path: Path) -> bool:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    return not path.is_symlink() and "[model]" not in text and ("poses" in text or "temperatures_C" in text)


KINDS: dict[str, tuple[type[PageState], Callable[[WorkbenchSettings, Any], Request]]] = {
    "diagnose": (MissingPage, diagnosis),
    "ladder": (MissingPage, ladder),
    "plan": (PlanPage, plan),
    "audit": (AuditPage, audit),
    "discover": (DiscoverPage, discover),
    "coefficients": (TwoModelsPage, coefficients),
    "whatif": (ModelsPage, what_if),
    "import": (UploadPage, bring_in),
}
