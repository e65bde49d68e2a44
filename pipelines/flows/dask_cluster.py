"""Distribution of work on an archive over Dask workers by Prefect's task runner; Prefect is imported only for work."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pipelines.flows.local import own_server, reach_named
from pipelines.orchestrator.settings import LOCAL
from pipelines.parallel import Distributor
from schemas.errors import WrongUse
from schemas.library import require

SCHEMES = ("tcp://", "tls://", "ucx://", "ws://", "wss://")


def on_dask(address: str, workers: int = 1, home: Path | None = None) -> Distributor | None:
    """The distribution over the workers of a Dask cluster; None without an address.

    Parameters
    ----------
    address : of a Dask scheduler, or ``local`` for a cluster of processes on this machine
    workers : processes of the local cluster
    home : folder of the orchestrator that is started without PREFECT_API_URL; None: a temporary folder

    Raises
    ------
    WrongUse
        The address is not the address of a scheduler, or the libraries of Dask are not installed.
    """
    if not address:
        return None
    _refuse_address(address)
    require("prefect_dask", "dask", "--dask: work on Dask workers")

    def distribute(function: Callable[[Any], Any], partitions: Sequence[Any], name: str) -> list[Any]:
        with _orchestrator(home):
            from pipelines.flows.dask import run_on_dask  # Prefect reads its settings when it is imported

            return run_on_dask(function, partitions, address, workers, name)

    return distribute


def _refuse_address(dask: str) -> None:
    if dask != LOCAL and not dask.startswith(SCHEMES):
        raise WrongUse(
            f"--dask: '{dask}' is no address of a scheduler, tcp://HOST:PORT is needed, or '{LOCAL}' for a cluster on this "
            "computer; start one with 'dask scheduler' and 'dask worker'"
        )


@contextmanager
def _orchestrator(home: Path | None) -> Generator[None, None, None]:
    """A context with an orchestrator: the one of PREFECT_API_URL, or a temporary one."""
    if os.environ.get("PREFECT_API_URL"):
        reach_named()
        yield
        return
    with TemporaryDirectory(prefix="tumbleline-", ignore_cleanup_errors=True) as spare, own_server(home or Path(spare)):
        yield
