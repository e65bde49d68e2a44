"""An archive with 500 units in a run, broken runs, and scripts in every name."""

from pathlib import Path
from urllib.parse import urlencode

from benchmarks.generated_archive import write_archive
from benchmarks.workbench import tables, write
from pipelines.archive import Archive

SCRIPT = "<img src=x onerror=window.ran=1>"
MARKUP = '"><script>window.ran=1</script>'
LONG = "S" * 64
MANY = [f"MANY{k:04d}" for k in range(500)]


def addresses(run: str) -> list[str]:
    """Pages of a workbench with a script in every part of their address, and of the run in which every name is one."""
    return [
        "/units?" + urlencode({"search": MARKUP, "station": SCRIPT}), f"/run?run={run}", f"/unit?run={run}",
        "/unit?" + urlencode({"run": run, "unit": SCRIPT, "against": "pose"}), f"/unit?run={run}&unit={LONG}",
        f"/missing?source={run}", f"/station?run={run}", "/audit?" + urlencode({"device": MARKUP}),
        "/plan?" + urlencode({"recipe": SCRIPT, "pose": MARKUP}), "/models?" + urlencode({"model": MARKUP}),
        "/upload?" + urlencode({"file": SCRIPT}),
    ]  # fmt: skip


def unusual_archive(root: Path) -> None:
    """Write it to a folder, beside the runs of a factory."""
    write_archive(root, 24, years=3.0, seed=7, workers=1)
    archive = Archive(root)
    write(archive, 1, MANY, tables(MANY, 24, 1))
    for number, spoiled in ((2, "run.json"), (3, "grades.parquet"), (4, "dwells.json")):
        run = write(archive, number, ["B1", "B2"], tables(["B1", "B2"], 24, number))
        place = root / "runs" / run / spoiled
        place.write_bytes(place.read_bytes()[:40])
        place.parent.rename(place.parent.with_name(f"broken-{number}"))
    named(archive)


def named(archive: Archive) -> None:
    """A run in which every name is a script: recipe, device, station, person, and a serial of 64 characters."""
    made = tables([SCRIPT, LONG], 24, 5)
    made["grades"]["reasons"] = MARKUP
    made["dwells"]["pose"] = SCRIPT
    lot = {"device": MARKUP, "units": [{"serial": name, "slot": k} for k, name in enumerate((SCRIPT, LONG))], "seed": 1}
    about = {"recipe": {"name": SCRIPT, "effects": ["bias", SCRIPT]}, "lot": lot, "station": {"name": SCRIPT}}
    run = archive.open_run("named", about, {"number": 5})
    for stage, names in (("reduce", ("dwells",)), ("fit", ("residuals", "coefficients")), ("grade", ("grades",))):
        run.save(stage, f"named-{stage}", {name: made[name] for name in names}, {"inputs": {}})
    run.seal()
