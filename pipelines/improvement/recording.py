"""A recording of another system as a run of the archive: recognised, imported and fitted, with the equivalent command."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inertial.counts import number_of
from pipelines.importers.exchange import is_exchange
from pipelines.importers.mapping import build
from pipelines.importers.proposal import FEWEST_OF_NORM, Proposal, has_reference
from pipelines.importers.recognition import Recognition, recognise
from schemas.errors import DataRejected, WrongUse

if TYPE_CHECKING:
    from pipelines.improvement.documents import RecordingDocument

Working = Callable[[str], AbstractContextManager[Any]]


def bring_in(
    paths: list[Path], archive: str | None, working: Working, group: str = "", join: str = ""
) -> "RecordingDocument | None":
    """The import of a recording as it is recognised; None for a table of dwells, which needs none.

    Parameters
    ----------
    paths : files of one recording · join : how several are joined, one after another by default

    Raises
    ------
    WrongUse
        The file leaves something open; the message has the command to complete.
    DataRejected
        It has too few positions for a fit, or the import refuses it.
    """
    from pipelines.diagnosis.import_document import import_document

    with working(f"recognising {paths[0].name}"):
        seen = recognise(paths, join=join or ("rows" if len(paths) > 1 else ""), group=group)
        proposal = None if seen.is_exchange else seen.for_fit()
    if seen.is_exchange:
        return None
    name = " + ".join(path.name for path in paths)
    if len(paths) > 1 and is_exchange(seen.content.table.columns):
        raise WrongUse(f"{name}: {len(paths)} tables of dwells, one is needed; write their rows into one file")
    if proposal is None:
        raise WrongUse(
            f"{name}: not recognised without doubt: {'; '.join(seen.open)}; complete the command: {seen.import_command}"
        )
    if not proposal.fit and not has_reference(proposal.keys):
        raise DataRejected(f"{name}: {_too_little(seen, proposal)}")
    build(proposal.keys, name)
    done = import_document(paths, proposal.keys, name, proposal.fit, archive, None, working)
    guessed = seen.guessed
    return {
        "files": [str(path) for path in paths],
        "form": seen.source.form,
        "rows": len(seen.content.table),
        "columns": {meaning: column for meaning in proposal.keys["columns"] if (column := guessed.column(meaning))},
        "reason": guessed.triad.reason or guessed.columns[guessed.column("x")].reason,
        "output_unit": guessed.output.meaning,
        "output_reason": guessed.output.reason,
        "rate_hz": seen.rate_hz,
        "dwells": done["dwells"],
        "assumed": list(proposal.assumed),
        "remarks": [*done["remarks"], *proposal.remarks],
        "command": proposal.command(paths),
        "run": done["run"],
        "fit": "faces" if proposal.fit == "faces" else "norm" if proposal.fit else None,
        "lines": done["lines"],
        "dwell_list": done["dwell_list"],
    }


def _too_little(seen: Recognition, proposal: Proposal) -> str:
    """Why a recording supports no fit, what is needed, and what can be done with it."""
    sphere = seen.guessed.triad.sphere
    if sphere is not None and sphere.still:
        found, needed = (
            "one pose whose force is not known",
            "its unit in g or m/s², and a face that is up, for its bias",
        )
    else:
        stops = len(seen.output) if seen.guessed.dwells and seen.output is not None else proposal.stops
        where = "all" if proposal.places in {0, stops} else number_of(proposal.places, "position")
        found, needed = (
            f"{stops} stops in {where}",
            f"{FEWEST_OF_NORM} positions at rest for a fit to the norm of gravity",
        )
    remedies = [
        *proposal.remarks,
        "record each position for some seconds",
        "see its noise with 'tumbleline noise allan'",
    ]
    return f"{found}, {needed} are needed; {', or '.join(remedies)}"
