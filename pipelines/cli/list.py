"""``tumbleline list``: the runs of the archive."""

from inertial.counts import number_of
from pipelines.archive import Archive, RunInfo
from pipelines.cli.options import ArchiveOption, JsonOption
from pipelines.cli.printing import conclude, print_table, remark, say
from schemas.tables import ADEQUATE

PART = "Results"
ORDER = 310
SUMMARY = "List the runs of the archive."
EXAMPLES = ("tumbleline list", "tumbleline list --json")


def command(archive: ArchiveOption = None, *, as_json: JsonOption = False) -> None:
    """List the runs of the archive in the order of their start. Exit status 1: files of a finished run are missing."""
    store = Archive(archive)
    store.refuse_misnamed(archive)
    infos = store.runs()
    for name in store.without_start({info.id for info in infos}):
        remark(f"list: folder runs/{name} has no run.json; restore it from a copy, see 'tumbleline verify'")
    passed = not any(info.lost for info in infos)
    conclude(
        {"archive": str(store.root), "runs": infos}, lambda _: _print(infos, store), as_json=as_json, passed=passed
    )


def _print(infos: list[RunInfo], store: Archive) -> None:
    if not infos:
        say(f"no run in {store.root}; make one with 'tumbleline run'")
        return
    say(f"{number_of(len(infos), 'run')} in {store.root}")
    lines = [
        [info.id, info.started[:16].replace("T", " "), info.station or "import", _result(info), _units(info)]
        for info in infos
    ]
    print_table(["run", "started (UTC)", "station", "passed", "units"], lines)
    for info in infos:
        if info.lost:
            say(
                f"{info.id}: {info.lost} not there; restore from a copy, see 'tumbleline verify {info.id}'",
                style="bold red",
            )
        if info.rerun_of:
            say(f"{info.id} is a re-run of {info.rerun_of}")


def _result(info: RunInfo) -> str:
    """The number of units that passed, or the state of the run; and the verdict on its model where that is not adequate."""
    if not info.finished:
        return "unfinished"
    if info.lost:
        return "files missing"
    passed = "not graded" if info.graded is None else f"{info.passed} of {info.graded}"
    return passed if info.verdict in {None, ADEQUATE} else f"{passed}, model {info.verdict}"


def _units(info: RunInfo) -> str:
    units = info.units
    listed = ", ".join(units) if len(units) <= 3 else f"{units[0]} … {units[-1]} ({len(units)})"
    return f"{listed}, {info.device}"
