"""Remarks about a run on standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.cli.options import error_console

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.archive import Run


def print_remarks(run: Run, serials: Sequence[str]) -> None:
    """Print missing or foreign signatures and differing library versions on standard error."""
    from pipelines.certificates.coefficient_remarks import library_remarks, signature_remarks

    for line in (*signature_remarks(run, serials), *library_remarks(run)):
        error_console().print(f"show: {line}", markup=False, soft_wrap=True)
