"""The archive of a flow: its address is a parameter, which is stored and shown; its credentials are never stored.

A flow takes the credentials from its environment (``TUMBLELINE_ARCHIVE``, or the variables of the object store), or
from a Secret block of the orchestrator, which is encrypted.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

from pipelines.archive import Archive
from pipelines.orchestrator.credentials import BLOCK, VARIABLE, refuse_credentials, without_credentials
from schemas.errors import WrongUse


def archive_of(parameter: str | None) -> Archive:
    """The archive of a flow's parameter, with the credentials of this process.

    Parameters
    ----------
    parameter : an address without credentials; ``block:NAME`` for the address in a Secret block; None: TUMBLELINE_ARCHIVE of
        the environment. The address of the environment is used where it differs only by its credentials.

    Raises
    ------
    WrongUse
        The parameter has credentials, or the block does not exist.
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
    """A context in which flows of this process find an archive by its address without credentials; it gives this address."""
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
        block: Any = Secret  # load can be synchronous or not; its types name only the other kind
        secret = block.load(name, _sync=True)
    except ValueError:
        raise WrongUse(
            f"archive: the orchestrator has no Secret block '{name}', one with the archive's address is needed; save it on the "
            "server's page under Blocks"
        ) from None
    return str(secret.get())
