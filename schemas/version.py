"""The version of the tables' schemas: it is written into every file, and is raised by one when the columns of a table change."""

from schemas.errors import ArchiveUnusable

VERSION = 1


def refuse_newer(version: object, where: str) -> None:
    """Refuse files of a newer version, whose columns may have another meaning.

    Parameters
    ----------
    where : name of the file in messages.
    """
    if isinstance(version, int) and version > VERSION:
        raise ArchiveUnusable(
            f"archive: {where} has schema {version}, this version knows up to {VERSION}; use a newer version"
        )
