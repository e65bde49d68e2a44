"""The archive that a flow works on: its address is a parameter, which is stored and shown; its credentials never are.

A flow's process finds the credentials in its own environment (``TUMBLELINE_ARCHIVE``, or the variables of the object store), or
in a Secret block of the orchestrator, which stores it encrypted.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from pipelines.archive import Archive
from pipelines.flows.credentials import BLOCK, VARIABLE, refuse_credentials, without_credentials
from schemas.errors import WrongUse

if TYPE_CHECKING:
    from collections.abc import Generator


def archive_of(parameter: str | None) -> Archive:
    """The archive that a flow's parameter names, with the credentials of this process.

    Parameters
    ----------
    parameter : an address without credentials; ``block:NAME`` for the one in a Secret block; where None, the environment's
        TUMBLELINE_ARCHIVE. The environment's whole address is used where it is the same but for its credentials.

    Raises
    ------
    WrongUse
        The parameter holds credentials, or there is no block of the name.
    """
    refuse_credentials(parameter)
    if parameter is None:
        return Archive()
    if parameter.startswith(BLOCK):
        return Archive(_of_block(parameter.removeprefix(BLOCK)))
    own = os.environ.get(VARIABLE, "")
    return Archive(own if own and without_credentials(own) == parameter else parameter)


@contextmanager
def named(archive: Archive) -> Generator[str]:
    """A block in which flows of this process find an archive by its address without credentials, which it gives."""
    whole = archive.address
    shown = without_credentials(whole)
    if shown == whole:
        yield shown
        return
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = whole
    try:
        yield shown
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def _of_block(name: str) -> str:
    from prefect.blocks.system import Secret

    try:
        block: Any = Secret  # its load is of both kinds, and its types say the other
        found = block.load(name, _sync=True)
    except ValueError:
        raise WrongUse(
            f"archive: the orchestrator has no Secret block '{name}', one with the archive's address is needed; save it on the "
            "server's page under Blocks"
        ) from None
    return str(found.get())
