"""The input of ``allan`` and ``psd``, a file of samples or a run of the archive, and their pictures and page."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import Archive
from pipelines.cli.printing import error_console, publish
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from pipelines.importers.series import EvenSeries


def even_series(
    source: str,
    columns: str,
    clock: tuple[str, str, float | None],
    unit: str,
    archive: str | None,
    stretch: int | None,
) -> EvenSeries | None:
    """The samples of a file or an import; None for a captured run, which has figures of its own.

    Parameters
    ----------
    clock : column and unit of the time, and rate in Hz, as they were given

    Raises
    ------
    WrongUse
        An option of files was given for a run.
    """
    from pipelines.importers.files import is_file
    from pipelines.importers.series import series_of_file, series_of_run

    time, time_unit, rate = clock
    if is_file(source):
        named = [name.strip() for name in columns.split(",") if name.strip()]
        with error_console().status(f"reading {Path(source).name}"):
            return series_of_file(Path(source), named, time=time, time_unit=time_unit, rate_hz=rate, unit=unit)
    if columns or time or rate is not None or unit:
        raise WrongUse(
            f"{source}: --columns, --time, --rate and --unit are for files, and there is no such file; correct one"
        )
    run = Archive(archive).run(source)
    return None if run.about.get("capture") else series_of_run(run, stretch)


def write_pictures(document: dict[str, Any], plot: Path | None, page: Path | None) -> None:
    """Draw a document of ``allan`` or ``psd`` as a picture, and as a page with its tables."""
    if plot is None and page is None:
        return
    from pipelines.drawing.picture import picture, refuse_ending
    from pipelines.report.noise_page import noise_chart, noise_page

    if plot is not None:
        refuse_ending(plot, "--plot")
        publish(plot, picture(noise_chart(document), plot.suffix.lower()), "plot")
    if page is not None:
        publish(page, noise_page(document), "page")
