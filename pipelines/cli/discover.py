"""``tumbleline discover``: what the lots of an archive show together that one lot cannot."""

from datetime import date
from functools import partial
from pathlib import Path
from typing import Annotated

from pipelines.archive import Archive
from pipelines.cli.next_commands import archive_words
from pipelines.cli.options import ArchiveOption, JsonOption, names_in, option
from pipelines.cli.printing import conclude, give, publish
from schemas.errors import WrongUse

PART = "Certificates, trace, audit"
ORDER = 452
SUMMARY = "Find effects, far smaller than the noise of a lot, that an archive of many lots shows."
EXAMPLES = ("tumbleline discover --output discoveries.html", "tumbleline discover --driver station,slot --reach --json")


def command(
    archive: ArchiveOption = None,
    device: Annotated[str, option("--device KIND", "Kind of device; that of most runs by default.")] = "",
    since: Annotated[str, option("--since DATE", "Only lots from this day on; the evidence stays as it is.")] = "",
    driver: Annotated[str, option("--driver a,b", "Only effects by these attributes, such as wafer,station.")] = "",
    explain: Annotated[str, option("--explain ID", "One discovery: its levels, its lots, the next measurement.")] = "",
    model: Annotated[
        Path | None, option("--model FILE", "A model file: what is left with its effects in the model of every lot.")
    ] = None,
    html: Annotated[Path | None, option("--output --html -o FILE", "Write one page, with pictures.")] = None,
    workers: Annotated[
        int | None, option("--workers", "Processes that score new runs; as many as cores by default.", min=1)
    ] = None,
    dask: Annotated[str, option("--dask ADDRESS|local", "Score runs on Dask workers.")] = "",
    *,
    reach: Annotated[bool, option("--reach", "Print the smallest effects that this archive could have shown.")] = False,
    populations: Annotated[
        bool, option("--populations", "Test coefficients for two populations and correlations; a second for each.")
    ] = False,
    looking_back: Annotated[
        bool, option("--looking-back", "Judge all lots again with the attributes known now; nothing is stored.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Pool the lots of an archive: effects that differ by wafer, station, slot, firmware or date, or that all lots have.

    It may be repeated after every night's runs: the probability of a false discovery does not grow.
    Exit status 1: there is a new discovery, named or unexplained.
    """
    from pipelines.cli.text.discovery_text import print_discoveries, print_explained
    from pipelines.discovery.discover import Look, discovered, explained
    from pipelines.flows.dask_cluster import on_dask
    from pipelines.jobs.model_files import chosen_effects
    from pipelines.parallel import processors

    count = workers or processors()
    try:
        day = date.fromisoformat(since).isoformat() if since else ""
    except ValueError:
        raise WrongUse(f"discover: --since is '{since}', a day as 2026-03-14 is needed") from None
    look = Look(
        device=device,
        since=day,
        drivers=names_in(driver),
        effects=() if model is None else tuple(chosen_effects("", model, "discover") or ()),
        looking_back=looking_back,
        populations=populations,
        explained=bool(explain),
        workers=count,
        distribute=on_dask(dask, count),
    )
    looked = discovered(Archive(archive), look)
    document = looked.document
    if html is not None:
        from pipelines.discovery.page import render

        publish(html, render(looked.found, document, str(Archive(archive).root)), "discover")
    if explain:
        give(explained(document, explain), print_explained, as_json=as_json)
        return
    given = {"--device": device, "--since": since, "--driver": driver, "--model": str(model or "")}
    again = [*archive_words(archive), *(word for pair in given.items() if pair[1] for word in pair)]
    show = partial(print_discoveries, again=again, reach=reach)
    conclude(document, show, as_json=as_json, passed=not document["new"])
