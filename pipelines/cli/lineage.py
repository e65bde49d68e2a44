"""``tumbleline lineage``: from a certificate to the raw samples and back."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from inertial.counts import number_of
from pipelines.cli.options import STANDARD_OUTPUT, ArchiveOption, JsonOption, argument, option, outputs
from pipelines.cli.printing import console, print_json, say

if TYPE_CHECKING:
    from rich.tree import Tree

PART = "Certificates, trace, audit"
ORDER = 430
SUMMARY = "Show the origin of certificates, tables and samples, and the results made from them."
LONGEST = 10_000  # characters of a line in a pipe, which has no width
EXAMPLES = ("tumbleline lineage latest", "tumbleline lineage SN1 --output sn1.jsonld")


def command(
    target: Annotated[
        str, argument("UNIT|RUN|FILE", "A serial number, a run, a file of the archive, or a copy of such a file.")
    ] = "latest",
    output: Annotated[
        list[Path] | None,
        option(
            "--output -o FILE|DIR",
            "The lineage as W3C PROV in JSON-LD (.jsonld, .json, - for standard output); in a folder, an RO-Crate with every "
            "file of it. May be repeated.",
        ),
    ] = None,
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Show the origin of certificates, tables and samples, and the results made from them: by whom, when, with which code."""
    from pipelines.archive import Archive, files
    from pipelines.lineage import lineage
    from pipelines.lineage.prov import prov_of
    from pipelines.lineage.ro_crate import write_crate
    from pipelines.lineage.tree import tree_of

    made = outputs(output, {"prov": (".jsonld", ".json", "-"), "crate": ("",)}, "lineage")
    prov, crate = made.get("prov"), made.get("crate")
    store = Archive(archive)
    store.refuse_none()
    traced = lineage(store, target)
    if prov == STANDARD_OUTPUT:
        print_json(prov_of(traced))
        return
    if prov is not None:
        files.publish(prov, files.json_bytes(prov_of(traced)), "lineage", "give another file with --output")
    copied = write_crate(store, traced, crate) if crate is not None else 0
    if as_json:
        print_json({**traced.document(), "prov": str(prov) if prov else None, "crate": str(crate) if crate else None})
        return
    if prov is None and crate is None:
        _print(tree_of(traced))
    if prov is not None:
        say(f"PROV in {prov}")
    if crate is not None:
        say(f"RO-Crate with {number_of(copied, 'file')} in {crate}")


def _print(tree: "Tree") -> None:
    """Print a tree: its lines are continued below at a terminal, and as long as they need to be in a pipe."""
    from pipelines.cli.console import limited

    out = console()
    if limited(out):
        out.print(tree)
    else:
        out.width = LONGEST
        out.print(tree, soft_wrap=True)
