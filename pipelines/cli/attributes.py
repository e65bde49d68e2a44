"""``tumbleline attributes``: what is known of units and runs beside the measurement: wafer, supplier, batch, firmware."""

from pathlib import Path
from typing import Annotated

from pipelines.archive import Archive
from pipelines.cli.groups import group
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give, print_table, say
from pipelines.discovery.documents import ListedAttributes

PART = "Certificates, trace, audit"
ORDER = 454
SUMMARY = "Add what is known of units and runs, such as wafer or firmware, to the archive."
EXAMPLES = ("tumbleline attributes add units.csv", "tumbleline attributes list")
EXAMPLES_OF = {
    "add": ("tumbleline attributes add units.csv", "tumbleline attributes add shifts.csv --by run --json"),
    "list": ("tumbleline attributes list", "tumbleline attributes list --json"),
}


def add(
    table: Annotated[Path, argument("FILE", "A .csv or .parquet file with a column serial, or run.")],
    by: Annotated[str, option("--by serial|run", "What a row is about.")] = "serial",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Add a table of attributes; a changed value is a new row, the old one is kept."""
    from pipelines.discovery.attributes import added_from

    give(*added_from(Archive(archive), table, by), as_json=as_json)


def list_(archive: ArchiveOption = None, *, as_json: JsonOption = False) -> None:
    """List the attributes with their levels, and of how many units they are known."""
    from pipelines.discovery.attributes import listed

    store = Archive(archive)
    store.refuse_none()
    give(listed(store), _print, as_json=as_json)


def _print(document: ListedAttributes) -> None:
    rows = document["attributes"]
    if not rows:
        say("no attribute is known; add some with 'tumbleline attributes add FILE'")
        return
    lines = [
        [row["attribute"], row["of"], str(row["known"]), str(row["levels"]), row["judged_as"], row["such_as"]]
        for row in rows
    ]
    print_table(["attribute", "of", "known", "levels", "judged as", "such as"], lines)


app = group(SUMMARY, {"add": add, "list": list_})
