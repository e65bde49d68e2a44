"""``tumbleline export``: coefficients for firmware, autopilots and spreadsheets."""

from __future__ import annotations

from pathlib import Path
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import ArchiveOption, JsonOption, RunArgument, error_console

PART = "Results"
ORDER = 340
SUMMARY = "Write coefficients for firmware and autopilots."
EXAMPLES = (
    "tumbleline export latest --format c --output calibration.h",
    "tumbleline export latest --format json --units SN1",
)

_FOLDER = Path(__file__).parent.parent / "export" / "formats"
_NAMES = ", ".join(found.name for found in iter_modules([str(_FOLDER)]))  # their names, without importing them

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.archive import Run
    from pipelines.export import UnitCalibration


def command(
    run: RunArgument = "latest",
    form: Annotated[str, typer.Option("--format", help=f"{_NAMES}.")] = "json",
    units: Annotated[
        str, typer.Option("--units", metavar="SN,…", help="Export only these units; default: all that passed.")
    ] = "",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Output file; default: standard output.")
    ] = None,
    nominal: Annotated[
        float | None, typer.Option("--nominal", help="Output per g that the driver of the autopilot assumes.")
    ] = None,
    archive: ArchiveOption = None,
    *,
    failed: Annotated[bool, typer.Option("--failed", help="Also export units that failed their limits.")] = False,
    revoked: Annotated[
        bool, typer.Option("--revoked", help="Also export units whose calibration was revoked.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Write coefficients: bias b and response K as polynomials in temperature, to apply as a = K⁻¹(ã − b)."""
    from pipelines.archive import Archive
    from pipelines.certificates.coefficient_remarks import signature_remarks
    from pipelines.export import FORMATS, export_text, unit_calibrations
    from pipelines.jobs.model_files import use_formulas_of
    from schemas.errors import WrongUse, did_you_mean

    form = "json" if as_json else form
    if form not in FORMATS:
        raise WrongUse(f"export: no format is called '{form}'; {did_you_mean(form, FORMATS)}")
    source = Archive(archive).run(run)
    use_formulas_of(source)
    serials = tuple(serial.strip() for serial in units.split(",")) if units else ()
    chosen = unit_calibrations(source, serials, failed=failed, revoked=revoked)
    text = export_text(form, chosen, source.id, nominal)
    _print_certificates(source, chosen, signature_remarks(source, [c.unit for c in chosen]))
    if output is None:
        typer.echo(text, nl=False)
        return
    try:
        output.write_text(text, encoding="utf-8")
    except OSError as problem:
        raise WrongUse(
            f"export: {output} cannot be written ({problem.strerror}); give another file with --output"
        ) from None


def _print_certificates(run: Run, chosen: Sequence[UnitCalibration], signers: Sequence[str]) -> None:
    """Print the state of the certificates of these coefficients on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks
    from pipelines.certificates.days import today
    from pipelines.export import revoked_units

    given, day = {c.unit for c in chosen}, today()
    lines = [f"left out: {unit}, {one.words()}" for unit, one in revoked_units(run).items() if unit not in given]
    lines += [f"{c.unit}: {c.certified}" for c in chosen if c.certificate is not None and not c.certificate.holds(day)]
    bare = [c.unit for c in chosen if c.certificate is None]
    if bare:
        lines.append(f"not certified: {', '.join(bare)}; 'tumbleline certify {run.id}' gives them a period of validity")
    lines += [*library_remarks(run), *signers]
    for line in lines:
        error_console().print(f"export: {line}", markup=False, soft_wrap=True)
