"""``tumbleline demo``: an effect is hidden in the simulated station; find it, add it, compare the errors, and reveal it."""

from __future__ import annotations

import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.archive.files import ELSEWHERE, writing
from pipelines.cli.next_commands import Given, command_line, extension, judged_data
from pipelines.cli.options import JsonOption, argument, option
from pipelines.cli.printing import error_console, give, print_json, publish, remark, say
from pipelines.cli.text.demo_text import print_discovery_demo, print_ending
from schemas.errors import WrongUse
from schemas.progress import Progress

if TYPE_CHECKING:
    from pipelines.demo.measure import DemoLot
    from pipelines.demo.scenes import Scene
    from pipelines.diagnosis.documents import ComparisonDocument, DiagnosisDocument

PART = "Start here"
ORDER = 50
SUMMARY = "Hide an effect in the simulated station, find it, add it and see the error fall."
EXAMPLES = ("tumbleline demo --station", "tumbleline demo pendulous_mass --seed 11 --by-hand")


def command(
    effect: Annotated[
        str, argument("[NAME|random]", "Hidden effect, by the name of its physics or its id; random by default.")
    ] = "random",
    seed: Annotated[
        int | None, option("--seed", "Seed of the simulation; the same seed gives the same data.", min=0)
    ] = None,
    folder: Annotated[Path, option("--folder DIR", "Folder for measurements, model and report.")] = Path("demo"),
    lots: Annotated[
        int | None,
        option(
            "--lots N", "Hide something in a wafer of an archive of so many lots, and find it with discover.", min=60
        ),
    ] = None,
    *,
    station: Annotated[
        bool, option("--station", "Serve a station on this machine to practise lots, faults and stops on.")
    ] = False,
    yes: Annotated[bool, option("--yes -y", "Run without questions.")] = False,
    by_hand: Annotated[
        bool, option("--by-hand", "Only measure and write the files; continue with the commands yourself.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Hide an effect in the simulated station and find it from the measurements: compare, diagnose, extend, compare.

    The same lot is measured twice; the second run is fresh data that no fit sees.
    """
    if effect != "random" and (station or lots is not None):
        raise WrongUse(f"demo: '{effect}' is the effect of a game; --{'station' if station else 'lots'} takes no name")
    drawn = secrets.randbelow(100000) if seed is None else seed
    if station:
        _practise(folder, as_json=as_json)
        return
    if lots is not None:
        _archive(folder, drawn, lots, as_json=as_json)
        return
    from pipelines.demo.measure import measure
    from pipelines.demo.scenes import scene

    hidden = scene(effect, drawn)
    with writing(folder, "demo", ELSEWHERE):
        folder.mkdir(parents=True, exist_ok=True)
        earlier = _put_aside(folder / "model.toml")
    if earlier is not None:
        remark(f"demo: the model of an earlier demonstration is kept as {earlier}")
    with _bar() as progress:
        lot = measure(hidden, drawn, progress)
    with writing(folder, "demo", ELSEWHERE):
        lot.write(folder)
    if by_hand:
        _hand_over(folder, hidden, as_json=as_json)
        return
    game = _Game(folder, hidden, lot, asks=not (yes or as_json), quiet=as_json)
    document = game.play()
    if as_json:
        print_json({"seed": drawn, **document})


def _archive(folder: Path, seed: int, lots: int, *, as_json: bool) -> None:
    """An archive with something hidden in a wafer: written, judged, explained, and judged again with the effect in the model."""
    from pipelines.discovery.demonstration import made, played
    from pipelines.parallel import processors

    with writing(folder, "demo", ELSEWHERE), _bar(f"measuring {lots} lots") as progress:
        written, hidden = made(folder, seed, lots, lambda done: progress(done, lots, ""))
    with error_console().status("judging the archive night by night"):
        document = played(written, hidden, processors(), seed)
    give(document, print_discovery_demo, as_json=as_json)


def _practise(folder: Path, *, as_json: bool) -> None:
    """A station served faster than real time until Ctrl-C, its file in the folder, and faults from standard input."""
    from pipelines.cli.terminal import stopped
    from pipelines.demo.practice import RECIPE, TypedFaults, free_port, practice_file, practice_lot
    from schemas.station import load_station
    from stations.serving import serve

    file, lot = folder / "station.toml", practice_lot()

    def ready(host: str, port: int) -> TypedFaults:
        text, config = practice_file(port)
        publish(file, text, "station")
        speed, units = config.link.speed, [unit.serial for unit in lot.units]
        if as_json:
            print_json({"station": str(file), "host": host, "port": port, "speed": speed, "units": units})
            return TypedFaults(remark)
        say(
            f"A simulated station answers Modbus TCP at {host}:{port}. Its clock runs {speed:g} times as fast as yours."
        )
        say(f"In its slots: {', '.join(units)}.")
        say("\nIn a second terminal:", "bold")
        say(f"  {command_line('station', 'status', '--station', str(file))}")
        say(f"  {command_line('run', RECIPE, '--station', str(file))}")
        say("\nHere, while the lot is measured, type a fault and press Enter; Ctrl-C ends the station:", "bold")
        say("  door:for_s=60")
        return TypedFaults(say)

    with writing(folder, "demo", ELSEWHERE):
        folder.mkdir(parents=True, exist_ok=True)
    speed = practice_file()[1].link.speed
    serve(load_station(), lot, host="127.0.0.1", port=free_port(), speed=speed, stop=stopped(), ready=ready)


def _put_aside(model: Path) -> Path | None:
    """Rename a model file to the first free name with a number; its new name, None where there is no file."""
    if not model.exists():
        return None
    number = next(k for k in range(1, 10_000) if not model.with_name(f"{model.stem}-{k}{model.suffix}").exists())
    return model.rename(model.with_name(f"{model.stem}-{number}{model.suffix}"))


@contextmanager
def _bar(what: str = "measuring the lot twice") -> Generator[Progress]:
    from rich.progress import Progress as Bars

    with Bars(console=error_console(), transient=True) as bars:
        bar = bars.add_task(what, total=None)

        def show(done: int, total: int, note: str) -> None:
            bars.update(bar, completed=done, total=total, description=f"measuring  {note}" if note else what)

        yield show


def _hand_over(folder: Path, hidden: Scene, *, as_json: bool) -> None:
    files = [f"{name}.parquet" for name in ("dwells", "history", "fresh", "fresh-history")]
    lines = [
        f"The lot was measured twice, with one hidden effect. Files in {folder}: {', '.join(files)}.",
        "Begin with",
        f"  {_command('diagnose', folder, hidden.model)}",
    ]
    give({"folder": str(folder), "files": files, "effects": list(hidden.model)}, lines, as_json=as_json)


def _command(name: str, folder: Path, model: tuple[str, ...] | None) -> str:
    """A command to type, on the files of the demonstration."""
    chosen = ["--effects", ",".join(model)] if model else ["--model", str(folder / "model.toml")]
    again = ["--fresh", str(folder / "fresh.parquet"), "--fresh-temperatures", str(folder / "fresh-history.parquet")]
    start = [name, str(folder / "dwells.parquet"), *chosen, "--temperatures", str(folder / "history.parquet")]
    return command_line(*start, *(again if name == "compare" else ["--output", str(folder / "report.html")]))


class _Game:
    """One round: compare, diagnose, extend, compare, reveal."""

    def __init__(self, folder: Path, hidden: Scene, lot: DemoLot, *, asks: bool, quiet: bool) -> None:
        self.folder, self.hidden, self.lot, self.asks, self.quiet = folder, hidden, lot, asks, quiet
        self.model = list(hidden.model)

    def play(self) -> dict[str, Any]:
        """Play all steps of the demonstration; return the result."""
        if not self.quiet:
            say(
                f"Four units were measured on the simulated station, {self.lot.dwells['dwell'].nunique()} dwells each, and then "
                "once more. The station or the devices have an effect that the model does not contain."
            )
        before = self._compare("1. How good is the model?", first=True)
        diagnosis = self._diagnose()
        added = self._extend(diagnosis["recommended"])
        after = self._compare("4. How good is the extended model?", first=False) if added else before
        classes = [group["effects"] for group in diagnosis["classes"]]
        several = [effects for effects in classes if len(effects) > 1]
        document = {
            "hidden": {"kind": self.hidden.kind, "effect": self.hidden.effect, "physics": self.hidden.truth},
            "classes": classes,
            "recommended": diagnosis["recommended"],
            "unseen": diagnosis["unseen"],
            "added": added,
            "found": any(self.hidden.effect in effects for effects in classes),
            "told_apart": [self.hidden.effect] in classes,
            "not_told_apart": several,
            "next_measurements": diagnosis["next_measurements"] if several else [],
            "before": _errors(before),
            "after": _errors(after),
            "folder": str(self.folder),
        }
        if not self.quiet:
            self._step("5. What was hidden?", "")
            print_ending(document)
        return document

    def _compare(self, title: str, *, first: bool) -> ComparisonDocument:
        from pipelines.cli.compare import print_comparison
        from pipelines.diagnosis.compare import compare

        self._step(title, _command("compare", self.folder, self.hidden.model if first else None))
        lot = self.lot
        with error_console().status("fitting"):
            document = compare(lot.dwells, self.model, lot.history, lot.fresh, lot.fresh_history)
        if not self.quiet:
            print_comparison(document, poses=0)
        return document

    def _diagnose(self) -> DiagnosisDocument:
        from pipelines.cli.diagnose import diagnosed
        from pipelines.cli.text.diagnosis_text import print_diagnosis

        self._step("2. What is missing?", _command("diagnose", self.folder, self.hidden.model))
        source = str(self.folder / "dwells.parquet")
        made, report = diagnosed(self.lot.dwells, self.lot.history, self.model, source, with_report=True)
        document = made.document
        document["history"] = str(self.folder / "history.parquet")
        publish(self.folder / "report.html", report, "report")
        if not self.quiet:  # without commands: the next step of the game adds the effect
            print_diagnosis(document, made=made, data=None, model=self.folder / "model.toml")
        return document

    def _extend(self, recommended: list[str]) -> list[str]:
        """The effects added, written to the model file one version each."""
        chosen = self._asked_for(recommended)
        file = self.folder / "model.toml"
        data = judged_data(str(self.folder / "dwells.parquet"), str(self.folder / "history.parquet"), Given())
        lines = extension(file, chosen, self.hidden.model, data, new=True)[:-1]
        self._step("3. Add it.", "\n  ".join(lines) or "(nothing to add)")
        self.model = list(_write_model(file, self.hidden.model, chosen))
        return chosen

    def _asked_for(self, recommended: list[str]) -> list[str]:
        """The effects to add: those recommended, or others."""
        from pipelines.jobs.model_files import refuse_unknown_effects

        if not self.asks:
            return recommended
        answer = typer.prompt("\nWhich effects shall be added (a,b,c)?", default=",".join(recommended) or "none")
        names = [part.strip() for part in str(answer).split(",") if part.strip() not in {"", "none"}]
        refuse_unknown_effects(names, "demo")
        return [name for name in names if name not in self.hidden.model]

    def _step(self, title: str, line: str) -> None:
        if self.asks:
            typer.prompt("\nPress Enter to continue", default="", show_default=False, prompt_suffix=" ")
        if not self.quiet:
            say(f"\n{title}", style="bold cyan")
            if line:
                say(f"  {line}", style="dim")


def _errors(document: ComparisonDocument) -> dict[str, float | None]:
    return {name: document[name] for name in ("rms_ug", "heldout_rms_ug", "fresh_rms_ug", "floor_ug")}


def _write_model(file: Path, start: tuple[str, ...], chosen: list[str]) -> tuple[str, ...]:
    """The model's file with one version per effect; its effects."""
    from datetime import UTC, datetime

    from pipelines.improvement.improvement import with_effects
    from pipelines.jobs.model_files import ModelStep, new_model, publish_model

    now = datetime.now(UTC).replace(microsecond=0)
    steps = [ModelStep(name, "demo", now, "the diagnosis names it", "dwells.parquet") for name in chosen]
    text, model = with_effects(new_model(file, start, "demo", now), steps, file)
    publish_model(file, text)
    return tuple(model.model.effects) if model else start
