"""Certified coefficients, and remarks on their files: missing or foreign signatures, differing versions of libraries."""

import hashlib
from collections.abc import Iterable, Mapping
from typing import Any

from pipelines.archive import Run, files
from pipelines.archive.run import names_in
from pipelines.archive.signatures import BAD, GOOD, UNSIGNED, check, public_keys
from pipelines.archive.store import Place, first_line
from pipelines.certificates.entries import folder_of
from pipelines.certificates.ledger import Ledger, certified_table
from pipelines.certificates.validity import Calibration
from schemas.errors import ArchiveUnusable

TABLES = ("coefficients", "covariance", "grades")


def signature_remarks(run: Run, serials: Iterable[str] = ()) -> list[str]:
    """Remarks on files of a run, and certificates of its units, without a signature by a configured key; empty without keys.

    Parameters
    ----------
    serials : units whose certificates for the run are checked.

    Raises
    ------
    ArchiveUnusable
        A file was edited after it was signed.
    """
    keys = public_keys()
    if not keys:
        return []
    by_state: dict[str, list[str]] = {}
    manifests = (run.path / f"{name}.json" for name in ("run", *TABLES))
    for path in (*(manifest for manifest in manifests if manifest.is_file()), *_certificates(run, serials)):
        state = check(files.read_json(path), keys)
        name = str(path)[len(str(run.archive.root)) :].lstrip("/\\")
        if state == BAD:
            raise ArchiveUnusable(
                f"archive: {name} was edited after it was signed; restore it from a copy, see 'tumbleline verify {run.id}'"
            )
        if state != GOOD:
            by_state.setdefault(state, []).append(name)
    return [
        f"{'not signed' if state == UNSIGNED else 'signed with a key that is not the own'}: {', '.join(names)}"
        for state, names in sorted(by_state.items())
    ]


def changed_tables(run: Run) -> list[str]:
    """Tables of the result of a run whose hashes differ from those in their manifests."""
    names = names_in(run.path)
    present = [name for name in TABLES if {f"{name}.parquet", f"{name}.json"} <= names]
    return [name for name in present if files.sha256(run.path / f"{name}.parquet") != run.manifest(name)["sha256"]]


def library_remarks(run: Run) -> list[str]:
    """Remarks on libraries with more than one version among the tables of the run."""
    present = [name for name in run.tables() if (run.path / f"{name}.json").is_file()]
    return differing_libraries(run.id, {name: run.manifest(name) for name in present})


def _certificates(run: Run, serials: Iterable[str]) -> list[Place]:
    ledger, root = Ledger(run.archive.root), run.archive.root
    return [
        root / folder_of(serial) / f"{calibration.event.sequence:06d}.json"
        for serial in serials
        for calibration in ledger.calibrations(serial)
        if calibration.run == run.id
    ]


REPORT = "report"  # only for display


def differing_libraries(run: str, manifests: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A line for each library with more than one version among the tables of a run.

    Versions are not in the keys of stages (docs/decisions/re-runs.md), so after an update a run can have stages with
    different versions.

    Parameters
    ----------
    manifests : of the run's tables, by table.
    """
    versions: dict[str, dict[str, list[str]]] = {}
    for name, content in sorted(manifests.items()):
        libraries = content.get("libraries")
        if name != REPORT and isinstance(libraries, dict):
            for library, number in libraries.items():
                versions.setdefault(str(library), {}).setdefault(str(number), []).append(name)
    remarks: list[str] = []
    for library, by in sorted(versions.items()):
        if len(by) > 1:
            made = " and ".join(f"{number} ({', '.join(names)})" for number, names in sorted(by.items()))
            advice = f"check the numbers with 'tumbleline rerun {run} --check'"
            remarks.append(f"run {run}: tables made with {library} {made}; {advice}")
    return remarks


def coefficients_of(run: Run, calibration: Calibration) -> list[dict[str, Any]]:
    """Rows of the unit in the certified table of coefficients of the run; none where it certifies other results."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    name = certified_table(run, calibration.event)
    path = run.path / f"{name}.parquet"
    try:
        data = path.read_bytes()
        if hashlib.sha256(data).hexdigest() != calibration.event.coefficients:
            raise ArchiveUnusable(
                f"calibrations: {path} is not the table of certificate {calibration.certificate} (its hash "
                "differs); restore it from a copy"
            )
        # read_table would import pandas; a thread pool that is still starting aborts a short process at its end
        table = pq.ParquetFile(pa.BufferReader(data), pre_buffer=False).read(use_threads=False)
    except (OSError, pa.ArrowInvalid) as problem:
        raise ArchiveUnusable(
            f"calibrations: {path} cannot be read ({first_line(problem)}); restore it from a copy"
        ) from None
    # not table.take, for which pyarrow imports pandas
    return [row for row in table.to_pylist() if name == "coefficients" and row["unit"] == calibration.serial]
