"""``tumbleline station bring-up``: the first hour with one real device, with a person beside it."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from pipelines.cli.options import JsonOption, argument, option
from pipelines.cli.printing import print_json, print_table, publish, remark, say
from schemas.errors import STATION, StationError, WrongUse

if TYPE_CHECKING:
    from pipelines.commissioning.documents import ConformanceDocument, Platform
    from stations.bringup.session import BringUp

ON = "What is at the other end: hardware, simulator or replay? (Enter: not stated)"


def bring_up(
    profile: Annotated[
        str, argument("PROFILE", "The profile of the device; 'tumbleline station profiles' lists them.")
    ],
    link: Annotated[
        str, option("--link LINK", "tcp://HOST[:PORT], serial:DEVICE[,BAUD[,PARITY[,STOP]]] or visa:RESOURCE.")
    ],
    device_id: Annotated[int, option("--device-id", "Unit id of the device; 0: look for it.", min=0, max=255)] = 0,
    out: Annotated[Path | None, option("--out DIR", "New folder for page, recording and profile.")] = None,
    timeout: Annotated[float, option("--timeout", "Longest answer, s.", min=0.05, max=60.0)] = 2.0,
    silence: Annotated[
        float, option("--silence", "How long the link is cut in that step, s.", min=1.0, max=600.0)
    ] = 40.0,
    watch: Annotated[
        float, option("--watch", "How long the air of a chamber is watched, s.", min=0.0, max=3600.0)
    ] = 20.0,
    by: Annotated[str, option("--by NAME", "Who does it, for the page.")] = "",
    *,
    readings: Annotated[bool, option("--readings", "Read only: no order is offered.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Connect one real device step by step, and say for every register and promise: held, differs, or not tried.

    First it only reads: it looks for the device, its word order and its registers, and asks what the panel shows. Each order is
    given only after the word for it is typed. Whatever ends it, Ctrl-C and kill included, the device is left as it was found.
    Exit status 3: something differs, or nothing answers.
    """
    from stations.bringup.session import BringUp
    from stations.bringup.target import device_at
    from stations.links.recorder import recorded
    from stations.profile_files import load_profile

    loaded = load_profile(profile)
    device = device_at(link, loaded, device_id or 1)
    folder = _new_folder(out, loaded.name)
    person = _Typed()
    search = link.startswith("serial:") and "," not in link
    with recorded(folder / "frames.jsonl", f"bring-up of {loaded.name}"):
        session = BringUp(
            loaded,
            device,
            person,
            device_id,
            search,
            orders=not readings,
            timeout_s=timeout,
            silence_s=silence,
            watch_s=watch,
        )
        try:
            session.run()
        except (StationError, KeyboardInterrupt):
            _written(session, folder, person, by, as_json=as_json)
            raise
    document = _written(session, folder, person, by, as_json=as_json)
    raise typer.Exit(STATION if document["differs"] else 0)


def _new_folder(out: Path | None, profile: str) -> Path:
    folder = out or Path(f"bring-up-{profile}-{datetime.now(UTC):%Y%m%d-%H%M%S}")
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise WrongUse(f"bring-up: {folder} is there already, a new folder is needed; give another --out") from None
    except OSError as problem:
        raise WrongUse(f"bring-up: {folder} cannot be made ({problem.strerror}); give another --out") from None
    return folder


def _written(session: BringUp, folder: Path, person: _Typed, by: str, *, as_json: bool) -> ConformanceDocument:
    """Writes page, document and corrected profile, and prints the result."""
    import json

    from pipelines.commissioning.conformance import document_of
    from pipelines.commissioning.conformance_page import conformance_page
    from stations.bringup.corrected import corrected_name, corrected_text

    corrected = corrected_text(session.profile, session.findings, session.made)
    name = f"{corrected_name(session.profile)}.toml" if corrected else ""
    platform = _platform(person) if not session.ended else "not stated"
    document = document_of(session, verified_on=platform, by=by, recording="frames.jsonl", corrected=name)
    if corrected:
        publish(folder / name, corrected, "corrected profile")
    publish(folder / "conformance.json", json.dumps(document, ensure_ascii=False, indent=2) + "\n", "conformance")
    publish(folder / "conformance.html", conformance_page(document, folder / "frames.jsonl"), "page")
    if as_json:
        print_json(document)
    else:
        _print(document)
    return document


def _platform(person: _Typed) -> Platform:
    from pipelines.commissioning.documents import Platform as Known

    typed = person.ask(ON).strip().lower()
    return next((known for known in get_args(Known) if known == typed), "not stated")


def _print(document: ConformanceDocument) -> None:
    told = [point for point in document["points"] if point["verdict"] == "differs"]
    if told:
        lines = [[p["what"], p["found"], p["expected"], p["remedy"]] for p in told]
        print_table(["differs", "found", "expected", "what to do"], lines)
    untried = [
        point["what"] for point in document["points"] if point["verdict"] == "not tried" and point["part"] != "register"
    ]
    if untried:
        say(f"not tried: {', '.join(untried)}")
    state = "" if document["complete"] else "; it ended before its last step"
    say(
        f"{document['profile']}: {document['held']} held, {document['differs']} differ, {document['not_tried']} not tried{state}"
    )


class _Typed:
    """The person at the terminal, or lines on standard input; its end skips every further question."""

    def tell(self, text: str) -> None:
        """Shows a line on standard error."""
        remark(text)

    def ask(self, question: str) -> str:
        """A line of standard input."""
        remark(f"{question} ", style="bold", end="")
        line = sys.stdin.readline()
        if not line.endswith("\n") or not sys.stdin.isatty():
            remark("")
        return line.rstrip("\n")
