"""One evaluation of an archive: new runs are scored, their evidence is stored, and significant effects are named."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

from threadpoolctl import threadpool_limits

from inertial import effects as catalogue
from pipelines.archive import Archive
from pipelines.discovery.coefficient_populations import populations
from pipelines.discovery.discoveries import Discoveries, plain
from pipelines.discovery.documents import ComparedAlarm, DiscoverDocument, DiscoveryRow, UnexplainedRow
from pipelines.discovery.evidence_state import Evidences
from pipelines.discovery.findings import document_of
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.nights import brought_up, found_before, grown_by_days, remembered
from pipelines.parallel import Distributor
from schemas.errors import WrongUse, did_you_mean
from schemas.units import MICRO


@dataclass(frozen=True)
class Look:
    """The options of an evaluation of an archive.

    device : kind of device; that of most runs if empty · since : only lots from this day on; the result is not stored
    drivers : report only discoveries by these; all if empty · effects : ids added to the model of every lot
    looking_back : judge all lots again with all attributes known now; the result is not stored
    populations : search for two populations in each coefficient, and for correlated coefficients
    explained : a single discovery is requested; new ones are then left for the next evaluation to report
    workers, distribute : processes, or other machines, that score new runs
    """

    device: str = ""
    since: str = ""
    drivers: tuple[str, ...] = ()
    effects: tuple[str, ...] = ()
    looking_back: bool = False
    populations: bool = False
    explained: bool = False
    workers: int = 1
    distribute: Distributor | None = None


@dataclass(frozen=True)
class Looked:
    """What was found, with its document."""

    found: Discoveries
    document: DiscoverDocument


def discovered(archive: Archive, look: Look) -> Looked:
    """The discoveries of an archive.

    Raises
    ------
    WrongUse
        An unknown device, driver or effect, or no lot from that day on.
    """
    with threadpool_limits(1):
        source = DiscoveryArchive(archive, look.device)
        source.device  # noqa: B018 - refuses an unknown name before any run is scored
        source.score(look.workers, look.distribute)
        state = brought_up(source)
        if look.since or look.looking_back:
            found = _in_memory(source, look)
            document = document_of(found, looking_back=True)
        else:
            found, keep = Discoveries(source, state), not (look.effects or look.drivers or look.explained)
            document = remembered(source, state, document_of(found, found_before(source, state)), keep=keep)
        if look.effects:
            found, document = _with_effects(found, document, look.effects)
        if look.populations:
            document["population"] = populations(archive, source.device, look.workers)
    if look.drivers:
        document = _of_drivers(document, look.drivers)
    return Looked(found, document)


def _in_memory(source: DiscoveryArchive, look: Look) -> Discoveries:
    """Discoveries of the lots since a day, with the attributes known now; nothing is stored."""
    runs = [run for run in source.pooled() if run not in source.revoked and source.day_of(run) >= look.since]
    if source.pooled() and not runs:
        raise WrongUse(f"discover: no lot of {source.device} was measured since {look.since}; give an earlier --since")
    return Discoveries(source, grown_by_days(source, Evidences.fresh(source), runs))


def _with_effects(
    before: Discoveries, document: DiscoverDocument, effects: Sequence[str]
) -> tuple[Discoveries, DiscoverDocument]:
    """Discoveries with effects added to the model of every lot, and the document that compares every discovery with before."""
    catalogue.get_all(effects)
    pool = before.source.pool
    added = [effect for effect in effects if effect in pool.effects]
    if not added:
        raise WrongUse(
            f"discover: none of {', '.join(effects)} is beyond the model of the lots, one at least is needed; "
            f"{did_you_mean(effects[0], pool.effects)}"
        )
    changed = before.source.with_change(lambda lot: reduce(pool.with_effect, added, lot))
    after = Discoveries(changed, grown_by_days(changed, Evidences.fresh(changed), before.state.order))
    extended = document_of(after, looking_back=True)
    extended["model"] = [*document["model"], *added]
    extended["compared"] = [_compared(row, before, after) for row in document["discoveries"] if row["axes"]]
    return after, extended


def _compared(row: DiscoveryRow, before: Discoveries, after: Discoveries) -> ComparedAlarm:
    # the largest log evidence of the driver over all effects, and the size of the largest effect that is still named for it
    log_e = [
        max(
            (float(s.log_e.max()) for name, s in of.state.sensor.drivers.items() if plain(name) == row["driver"]),
            default=0.0,
        )
        for of in (before, after)
    ]
    left = (discovery for discovery in after.named if discovery.drivers[0] == row["driver"])
    return {
        "id": row["id"],
        "recommended": row["recommended"],
        "driver": row["driver"],
        "log_e_before": round(log_e[0], 2),
        "log_e_after": round(log_e[1], 2),
        "size_ug_before": row["size_ug"],
        "size_ug_after": next((MICRO * discovery.name.size()[0] for discovery in left), 0.0),
    }


def _of_drivers(document: DiscoverDocument, drivers: Sequence[str]) -> DiscoverDocument:
    known = [row["name"] for row in document["drivers"]]
    for driver in drivers:
        if known and driver not in known:
            raise WrongUse(f"discover: no driver is called '{driver}'; {did_you_mean(driver, known)}")
    document["discoveries"] = [row for row in document["discoveries"] if set(row["drivers"]) & set(drivers)]
    document["unexplained"] = [row for row in document["unexplained"] if row["driver"] in drivers]
    shown = {row["id"] for row in [*document["discoveries"], *document["unexplained"]]}
    document["new"] = [name for name in document["new"] if name in shown]
    document["held"] = [row for row in document["held"] if plain(row["driver"]) in drivers]
    document["drivers"] = [row for row in document["drivers"] if row["name"] in drivers]
    return document


def explained(document: DiscoverDocument, name: str) -> DiscoveryRow | UnexplainedRow:
    """The discovery or unexplained dependence of an id.

    Raises
    ------
    WrongUse
        There is none with that id.
    """
    rows = [*document["discoveries"], *document["unexplained"]]
    found = next((row for row in rows if row["id"].lower() == name.lower()), None)
    if found is None:
        hint = did_you_mean(name, [row["id"] for row in rows]) if rows else "there is none in this archive"
        raise WrongUse(f"discover: no discovery is called '{name}'; {hint}")
    return found
