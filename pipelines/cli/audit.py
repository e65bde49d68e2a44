"""``tumbleline audit``: drift, calibrations due, changes of stations, and the population."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, option
from pipelines.cli.printing import conclude, remark, say, short

if TYPE_CHECKING:
    from pipelines.audit.audit import Audit
    from pipelines.audit.finding import AuditFinding

PART = "Certificates, trace, audit"
ORDER = 450
SUMMARY = "Audit the archive: drift, calibrations due, stations that changed, the population."
EXAMPLES = ("tumbleline audit --output audit.html", "tumbleline audit --since 2026-01-01 --device ADXL355")

SHOWN = 12  # findings of one kind
BEGINNING = -700000.0  # days before any calibration


def command(
    archive: ArchiveOption = None,
    since: Annotated[
        str, option("--since DATE", "Changes, signals and figures from this day on; all by default.")
    ] = "",
    until: Annotated[
        str, option("--until DATE", "State of the archive at the end of this day; today by default.")
    ] = "",
    device: Annotated[str, option("--device KIND", "Only units of this kind.")] = "",
    station: Annotated[str, option("--station NAME", "Only what this station measured.")] = "",
    rules: Annotated[
        Path | None, option("--rules FILE", "Intervals, tolerances, check standards; built-in ones by default.")
    ] = None,
    page: Annotated[
        Path | None, option("--output -o FILE.html", "Write the report as one page that opens without a network.")
    ] = None,
    dask: Annotated[str, option("--dask ADDRESS|local", "Read runs on Dask workers.")] = "",
    workers: Annotated[
        int | None, option("--workers", "Processes that read runs; as many as cores by default.", min=1)
    ] = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """Audit the archive: re-calibrations due, drift, stations, check standards, population. Exit status 1: there are findings."""
    from pipelines.audit.audit import audit, refuse_nothing, scope_of
    from pipelines.audit.document import document
    from pipelines.audit.findings import findings
    from pipelines.audit.rules import load_rules
    from pipelines.flows.dask_cluster import on_dask
    from pipelines.parallel import processors

    store, scope = Archive(archive), scope_of(since, until, device, station)
    store.refuse_none()
    count = workers or processors()
    audited = audit(store, load_rules(rules), scope, distribute=on_dask(dask, count), workers=count)
    refuse_nothing(audited, str(store.root))
    audit_findings = findings(audited)
    if page is not None:
        from pipelines.archive.files import ELSEWHERE, publish
        from pipelines.audit.page import render

        publish(page, render(audited, audit_findings, str(store.root)).encode(), "audit", ELSEWHERE)
    show = partial(_show, audited, audit_findings, str(store.root), page)
    made = document(audited, audit_findings, str(store.root)) if as_json else {}
    conclude(made, show, as_json=as_json, passed=not audit_findings)


def _show(audited: "Audit", audit_findings: "list[AuditFinding]", root: str, page: Path | None, _: object) -> None:
    from inertial.counts import number_of
    from pipelines.audit.calibrations import date_of
    from pipelines.audit.document import counts
    from pipelines.audit.finding import WHO
    from pipelines.discovery.nights import discovered_before

    number, until = counts(audited), date_of(audited.scope.until - 1)
    everything = audited.scope.since <= BEGINNING
    period = f"all until {until}" if everything else f"{date_of(audited.scope.since)} to {until}"
    counted = ", ".join(number_of(number[f"{noun}s"], noun) for noun in ("calibration", "unit", "run", "station"))
    say(f"{counted}; {period}")
    shares: list[Any] = [share for share in audited.yields if share.of in {"all", "station"} and share.total]
    if shares:
        named = [(share.name or "import", short(100.0 * share.interval.value)) for share in shares]
        say(f"yield   {', '.join(f'{name} {value} %' for name, value in named)}")
    say(_certificates(audited))
    for who, words in WHO.items():
        of_one = [finding for finding in audit_findings if finding.who == who]
        if of_one:
            say(f"\n{words}", style="bold")
        for kind in dict.fromkeys(finding.kind for finding in of_one):
            messages = [finding.message for finding in of_one if finding.kind == kind]
            for message in messages[:SHOWN]:
                say(f"  · {message}")
            if len(messages) > SHOWN:
                say(f"  · … {len(messages) - SHOWN} more of this kind; --json and --output list all", style="dim")
    if not audit_findings:
        say("no action is needed")
    for device, count in discovered_before(Archive(root)):
        say(
            f"{number_of(count, 'discovery', 'discoveries')} of many lots of {device}: 'tumbleline discover'",
            style="dim",
        )
    if page is not None:
        remark(f"page    {page}")


def _certificates(audited: "Audit") -> str:
    from inertial.counts import number_of

    if not len(audited.certificates):
        return "ledger  nothing is certified: units are due an interval after their last pass"
    valid = f"{int(audited.due.valid.sum())} of {audited.due.row.size} units have one that is valid on {audited.certificates.day}"
    return f"ledger  {number_of(len(audited.certificates), 'certificate')}; {valid}"
