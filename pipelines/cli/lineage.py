"""``tumbleline lineage``: from a certificate to the raw samples and back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, console, print_json

PART = "Certificates, trace, audit"
ORDER = 430
SUMMARY = "Show the origin of certificates, tables and samples, and what was made of them."
EXAMPLES = (
    "tumbleline lineage latest",
    "tumbleline lineage SN1 --prov sn1.jsonld",
)


def command(
    target: Annotated[
        str,
        typer.Argument(
            metavar="UNIT|RUN|FILE", help="A serial number, a run, or a file of the archive or copied out of it."
        ),
    ] = "latest",
    prov: Annotated[
        Path | None, typer.Option("--prov", metavar="FILE", help="Write W3C PROV as JSON-LD; - for standard output.")
    ] = None,
    crate: Annotated[
        Path | None, typer.Option("--crate", metavar="DIR", help="Write an RO-Crate with every file of the lineage.")
    ] = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Tell where certificates, tables and samples came from and what was made of them: who, when, with what code."""
    from pipelines.archive import Archive, files
    from pipelines.lineage import lineage
    from pipelines.lineage.prov import prov_of
    from pipelines.lineage.ro_crate import write_crate
    from pipelines.lineage.tree import tree_of

    store = Archive(archive)
    store.refuse_none()
    found = lineage(store, target)
    if prov is not None and str(prov) == "-":
        print_json(prov_of(found))
        return
    if prov is not None:
        files.publish(prov, files.json_bytes(prov_of(found)), "lineage", "name another file with --prov")
    copied = write_crate(store, found, crate) if crate is not None else 0
    if as_json:
        print_json({**found.document(), "prov": str(prov) if prov else None, "crate": str(crate) if crate else None})
        return
    if prov is None and crate is None:
        console().print(tree_of(found), soft_wrap=True)
    for what in ([f"PROV in {prov}"] if prov else []) + ([f"RO-Crate with {copied} files in {crate}"] if crate else []):
        console().print(what, markup=False, soft_wrap=True)
