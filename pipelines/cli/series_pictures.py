"""The pictures and the page of ``allan`` and ``psd``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipelines.cli.options import error_console

if TYPE_CHECKING:
    from pathlib import Path


def write_pictures(document: dict[str, Any], plot: Path | None, page: Path | None) -> None:
    """Draw a document of ``allan`` or ``psd`` as a picture, and as a page with its tables."""
    if plot is None and page is None:
        return
    from pipelines.archive import files
    from pipelines.drawing.picture import picture, refuse_ending
    from pipelines.report.noise_page import noise_chart, noise_page

    if plot is not None:
        refuse_ending(plot, "--plot")
        files.publish(plot, picture(noise_chart(document), plot.suffix.lower()), "plot", files.ELSEWHERE)
        error_console().print(f"plot: {plot}", markup=False, soft_wrap=True)
    if page is not None:
        files.publish(page, noise_page(document).encode(), "page", files.ELSEWHERE)
        error_console().print(f"page: {page}", markup=False, soft_wrap=True)
