"""``tumbleline station monitor``: whether the line is healthy, its numbers for Prometheus, and alerts to a web hook."""

import os
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, option
from pipelines.cli.printing import conclude, print_text, say
from schemas.errors import WrongUse
from schemas.foreign import shown

if TYPE_CHECKING:
    from pipelines.monitoring.alerts import Poster
    from pipelines.monitoring.snapshot import Monitor


PROMETHEUS = "prometheus"


def monitor(
    archive: ArchiveOption = None,
    queue: Annotated[
        list[str] | None,
        option("--queue NAME", "A queue of PREFECT_API_URL that must have a worker online; may be repeated."),
    ] = None,
    days: Annotated[int, option("--last N", "Number of days before now whose runs are counted.", min=1, max=3650)] = 30,
    free_gb: Annotated[float, option("--free-gb GB", "Free space that the archive needs.", min=0.0)] = 1.0,
    webhook: Annotated[str, option("--webhook ADDRESS", "Post alerts to this address, with --port.")] = "",
    audits: Annotated[
        Path | None, option("--audits DIR", "Folder of audit documents whose findings are alerts too.")
    ] = None,
    host: Annotated[str, option("--host ADDRESS", "Address to listen on, with --port.")] = "127.0.0.1",
    port: Annotated[
        int | None,
        option(
            "--port",
            "Serve /metrics, /healthz and /livez here until stopped, as 9464; 0: a free port.",
            min=0,
            max=65535,
        ),
    ] = None,
    form: Annotated[
        str, option("--format prometheus", "Print the numbers in the format of Prometheus, and exit.")
    ] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """Report whether the line is healthy; exit status 1 if it is not.

    The command reads the archive, the orchestrator of PREFECT_API_URL, and the leases of the stations of this computer. It
    changes nothing. Its numbers contain no serial number.
    """
    from pipelines.monitoring.exposition import text
    from pipelines.monitoring.queue_numbers import configured
    from pipelines.monitoring.snapshot import Monitor

    address = webhook or os.environ.get("TUMBLELINE_WEBHOOK", "")
    if webhook and port is None:
        raise WrongUse("monitor: --webhook posts while the service runs, --port is needed; give it too")
    if form not in {"", PROMETHEUS}:
        raise WrongUse(f"monitor: --format {shown(form)}, {PROMETHEUS} is needed; correct it, or leave it out")
    if queue and not configured():
        raise WrongUse(
            f"monitor: --queue {shown(queue[0])}, PREFECT_API_URL is not set, so that no queue is watched; set it to the address "
            "of the server, or leave --queue out"
        )
    watched = Monitor(Archive(archive), days, free_gb, tuple(queue or ()))
    if port is not None:
        from pipelines.monitoring.alerts import Poster
        from stations.safety.folder import state_folder

        _serve(watched, host, port, Poster(address, state_folder()) if address else None, audits)
        return
    snapshot = watched.snapshot()
    if form:
        print_text(text(snapshot).decode())
        return
    document = snapshot.document()
    verdict = "healthy" if document["ok"] else f"{len(document['problems'])} problems"
    conclude(document, [*document["problems"], verdict], as_json=as_json, passed=document["ok"])


def _serve(monitor: "Monitor", host: str, port: int, poster: "Poster | None", audits: Path | None) -> None:
    from pipelines.cli.serving_pages import page_server, run_until_stopped
    from pipelines.monitoring.service import alerting, application
    from pipelines.serving.connections import listening_socket

    listener = listening_socket(host, port, "monitor")
    say(f"http://{host}:{listener.getsockname()[1]}/healthz")
    sys.stdout.flush()  # a program that started it waits for the address
    with listener, alerting(monitor, poster, audits) if poster is not None else nullcontext():
        run_until_stopped(page_server(application(monitor), listener), listener, "monitor")
