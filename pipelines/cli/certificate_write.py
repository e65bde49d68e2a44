"""``tumbleline certificate write``: the certificate of a certified unit, as PDF for people and as XML for programs."""

from pathlib import Path
from typing import Annotated

import typer

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import give, refuse_standard_output, remark
from schemas.errors import DONE, PART_FAILED


def write(
    names: Annotated[list[str], argument("RUN|UNIT…", "Runs, serial numbers or numbers of certificates (A1/2).")],
    laboratory: Annotated[
        Path, option("--laboratory FILE.toml", "TOML file with laboratory, customer, signatory and item.")
    ] = Path("laboratory.toml"),
    output: Annotated[Path, option("--output -o DIR", "Folder for the files; the current one.")] = Path(),
    sign_with: Annotated[
        str,
        option(
            "--sign-with KEY[,FILE]",
            "Sign PDF and XML: PKCS#12, or PEM with key and certificates; then a file with the password on its first line.",
        ),
    ] = "",
    address: Annotated[str, option("--address URL", "Print a QR code of this address; {number} is filled in.")] = "",
    archive: ArchiveOption = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Write, for every certified unit, SERIAL_N.pdf and SERIAL_N.xml with the content of ISO/IEC 17025, 7.8.2 and 7.8.4.

    A unit has to be certified before ('tumbleline certificate issue'): the number of its certificate is the one in the ledger.
    The same certificate gives the same bytes, unless it is signed. Exit status 1: some units of a run have no certificate.
    """
    from pipelines.certificates.document.issue import issue
    from pipelines.certificates.document.laboratory import read_laboratory
    from pipelines.certificates.document.signing import read_key

    refuse_standard_output(output, "certificate", "a folder for PDF and XML")
    who = read_laboratory(laboratory)
    file, _, password = sign_with.partition(",")
    key = read_key(Path(file), Path(password) if password else None) if sign_with else None
    done = issue(Archive(archive), names, who, output, key=key, address=address)
    lines = [f"certificate {entry.number}: {entry.pdf}, {entry.xml}" for entry in done.written]
    fields = ("serial", "run", "pdf", "xml", "signature")
    written = [{"certificate": entry.number, **{key: getattr(entry, key) for key in fields}} for entry in done.written]
    give({"certificates": written, "left_out": done.left_out}, lines, as_json=as_json)
    for serial, why in done.left_out.items():
        remark(f"certificate: {serial}: {why}")
    raise typer.Exit(PART_FAILED if done.left_out else DONE)
