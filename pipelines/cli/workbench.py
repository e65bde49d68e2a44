"""``tumbleline workbench``: archive, models and missing effects in a browser."""

import sys
from pathlib import Path
from typing import Annotated

from pipelines.archive import Archive
from pipelines.cli.options import argument, option
from pipelines.cli.printing import remark, say
from schemas.errors import WrongUse
from schemas.foreign import shown

PART = "Start here"
ORDER = 40
SUMMARY = "Show archive, models and missing effects in a browser."
EXAMPLES = ("tumbleline workbench", "tumbleline workbench archive --port 8765")


HOST = "127.0.0.1"


def command(
    archive: Annotated[str, argument("[ARCHIVE]", "The archive; TUMBLELINE_ARCHIVE or ./archive by default.")] = "",
    folder: Annotated[
        Path, option("--folder DIR", "Folder for files of dwells, recipes, models, uploads and lots.")
    ] = Path("workbench"),
    station: Annotated[
        list[Path] | None,
        option(
            "--station FILE",
            "A station of the operator's page; may be repeated. The built-in simulated one by default.",
        ),
    ] = None,
    port: Annotated[int, option("--port", "Port; 0: a free one.", min=0, max=65535)] = 8321,
    host: Annotated[
        str, option("--host ADDRESS[,NAME…]", "Interface to listen on, then further host names of this server.")
    ] = HOST,
    tls: Annotated[
        str,
        option("--tls FILE.pem[,FILE.pem]", "Certificate for HTTPS, then its private key where another file has it."),
    ] = "",
    workers: Annotated[int, option("--workers", "Processes for diagnoses and fits.", min=1, max=32)] = 2,
    *,
    pause_lots: Annotated[
        bool,
        option(
            "--pause-lots",
            "Pause lots when the workbench ends, for a service manager that ends their processes with it.",
        ),
    ] = False,
    behind_proxy: Annotated[
        bool, option("--behind-proxy", "A proxy in front encrypts; needed on other hosts without a certificate.")
    ] = False,
) -> None:
    """Serve pages on this machine: units, what is missing, upload, operator, plan, station and audit.

    Open the address that is printed: its token allows this browser to start work; without it the pages are read only. The pages
    load nothing from other servers and send nothing to them.
    """
    import os

    import uvicorn

    from pipelines.cli.serving_pages import page_server, run_until_stopped
    from pipelines.serving.connections import MOST, ConnectionLimits, listening_socket
    from pipelines.workbench.application import create_app
    from pipelines.workbench.settings import WorkbenchSettings
    from schemas.station import load_station

    certificate, key = (Path(name) if name else None for name in (*tls.split(",", 1), "")[:2])
    if tls and certificate is None:
        raise WrongUse(
            f"workbench: --tls {shown(tls)}: the certificate is missing, it is needed; name it before its key"
        )
    given = os.environ.get("TUMBLELINE_WORKBENCH_TOKEN", "")
    for path in station or ():
        load_station(path)  # a broken file is refused now, not when the page is opened
    # a proxy connects for everybody from one address, and limits addresses itself
    per_address = {"of_one_address": MOST} if behind_proxy else {}
    limits = ConnectionLimits(plain=certificate is None, **per_address)
    address, *names = (part.strip() for part in host.split(","))
    with listening_socket(address or HOST, port, "workbench", limits) as listener:
        listening = listener.getsockname()[1]
        settings = WorkbenchSettings(
            archive=Archive(archive or None).address, folder=folder, host=address or HOST, port=listening, names=tuple(names),
            tls=certificate is not None, proxied=behind_proxy, stations=tuple(station or ()), workers=workers,
            pause_lots=pause_lots, **({"token": given} if given else {}),
        )  # fmt: skip
        servers: list[uvicorn.Server] = []
        app = create_app(settings, ending=lambda: any(server.should_exit for server in servers))
        say(f"{settings.address}/?token={settings.token}")
        sys.stdout.flush()  # a program that started it waits for the address
        remark("Open the address above; Ctrl-C ends the workbench.")
        servers.append(page_server(app, listener, certificate, key))
        run_until_stopped(servers[0], listener, "workbench")
