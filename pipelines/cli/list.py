"""``tumbleline list``: the runs of the archive."""

from __future__ import annotations

from dataclasses import asdict

from pipelines.cli.options import ArchiveOption, JsonOption, console, print_json, print_table

PART = "Results"
ORDER = 310
SUMMARY = "List the runs of the archive."


def command(archive: ArchiveOption = None, *, as_json: JsonOption = False) -> None:
    """List the runs of the archive in the order of their start."""
    from pipelines.archive import Archive

    store = Archive(archive)
    infos = store.runs()
    if as_json:
        print_json({"archive": str(store.root), "runs": [asdict(info) for info in infos]})
        return
    if not infos:
        console().print(f"no run in {store.root}; make one with 'tumbleline run'", markup=False)
        return
    lines = [
        [i.id, i.started[:19].replace("T", " "), i.device, _units(i.units), "yes" if i.finished else "no"]
        for i in infos
    ]
    print_table(["run", "started (UTC)", "device", "units", "finished"], lines, title=f"archive {store.root}")


def _units(units: tuple[str, ...]) -> str:
    return ", ".join(units) if len(units) <= 3 else f"{units[0]} … {units[-1]} ({len(units)})"
