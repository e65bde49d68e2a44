"""``tumbleline archive``: the signing key, and the temporary files of killed writers."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, console, print_json
from schemas.counts import number_of

PART = "Certificates, trace, audit"
ORDER = 460
SUMMARY = "Maintain the archive: the signing key, and leftovers of interrupted commands."
EXAMPLES = (
    "tumbleline archive clean --dry-run",
    "tumbleline archive key --output signing.key",
)

app = typer.Typer(
    help="Maintain the archive.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)


@app.command()
def clean(
    archive: ArchiveOption = None,
    *,
    only_look: Annotated[
        bool, typer.Option("--dry-run", help="Show what would be removed, and change nothing.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Remove temporary files of killed writers and add finished runs to the chain; files in use are not touched."""
    from pipelines.archive import Archive
    from pipelines.archive.cleaning import clean as cleaned

    store = Archive(archive)
    store.refuse_none()
    done = cleaned(store, only_look=only_look)
    if as_json:
        print_json({"archive": str(store.root), "only_looked": only_look, **asdict(done)})
        return
    out = console()
    for place in done.removed:
        out.print(f"{'found' if only_look else 'removed'}  {place}", markup=False, soft_wrap=True)
    for place in dict.fromkeys(done.busy):
        out.print(f"in use   {place}", markup=False, soft_wrap=True)
    for run in done.sealed:
        out.print(f"sealed   {run}", markup=False, soft_wrap=True)
    word = "found" if only_look else "removed"
    out.print(f"{number_of(len(done.removed), 'leftover')} of killed writers {word} ({number_of(done.bytes, 'byte')})")
    if done.anchored:
        out.print(f"{number_of(done.anchored, 'calibration')} added to the chain")


@app.command()
def key(
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", metavar="FILE", help="File of the private key; default: in the user's configuration folder."
        ),
    ] = None,
    *,
    public: Annotated[
        bool, typer.Option("--public", help="Show the public key of the existing key; make no key.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Make the key that signs manifests, outside the archive, and show its public key."""
    from pipelines.archive import signatures
    from schemas.errors import WrongUse

    place = output or signatures.default_key_place()
    if public:
        place = output or signatures.key_place()
        if place is None:
            raise WrongUse("archive key: no key exists, one is needed; make it with 'tumbleline archive key'")
        made = signatures.private_key(place).public_key()
    else:
        within = next((one for one in place.resolve().parents if (one / "archive.json").is_file()), None)
        if within is not None:
            raise WrongUse(
                f"archive key: {place} lies in archive {within}, a place outside it is needed; give another with --output"
            )
        made = signatures.make_key(place)
    hexadecimal = made.public_bytes_raw().hex()
    if as_json:
        print_json({"name": signatures.name_of(made), "public": hexadecimal, "private_file": str(place)})
        return
    out = console()
    out.print(f"key      {signatures.name_of(made)}", markup=False)
    out.print(f"public   {hexadecimal}", markup=False, soft_wrap=True)
    out.print(f"private  {place}", markup=False, soft_wrap=True)
    if output is not None and not public:
        out.print(f"to sign with this key, set TUMBLELINE_SIGNING_KEY={place}", markup=False, soft_wrap=True)
