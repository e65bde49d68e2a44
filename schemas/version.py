"""The version of the tables' schemas: what travels with every file, and is raised by one when a table's columns change."""

from __future__ import annotations

from schemas.errors import ArchiveUnusable

VERSION = 1


def refuse_newer(version: object, where: str) -> None:
    """Refuse what a newer version wrote, whose columns may mean something else.

    Parameters
    ----------
    where : names the file in a message.
    """
    if isinstance(version, int) and version > VERSION:
        raise ArchiveUnusable(
            f"archive: {where} has schema {version}, this version knows up to {VERSION}; use a newer version"
        )
