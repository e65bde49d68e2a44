"""The coefficients of one calibration, read without a table library, for a short answering time."""

from __future__ import annotations

import hashlib
from typing import Any

from pipelines.archive import Run
from pipelines.archive.store import first_line
from pipelines.certificates.validity import Calibration
from schemas.errors import ArchiveUnusable


def coefficients_of(run: Run, calibration: Calibration) -> list[dict[str, Any]]:
    """Rows of the unit in the certified table of coefficients of the run."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    place = run.path / "coefficients.parquet"
    try:
        data = place.read_bytes()
        if hashlib.sha256(data).hexdigest() != calibration.event.coefficients:
            raise ArchiveUnusable(
                f"calibrations: {place} is not the table of certificate {calibration.certificate} (its hash "
                "differs); restore it from a copy"
            )
        # read_table imports pandas; and a thread pool that is still starting aborts so short a process at its end
        table = pq.ParquetFile(pa.BufferReader(data), pre_buffer=False).read(use_threads=False)
    except (OSError, pa.ArrowInvalid) as problem:
        raise ArchiveUnusable(
            f"calibrations: {place} cannot be read ({first_line(problem)}); restore it from a copy"
        ) from None
    # table.take would make an array of the row numbers, and pyarrow asks pandas whether they are a series
    return [row for row in table.to_pylist() if row["unit"] == calibration.serial]
