"""``tumbleline history``: the error of a model, version by version, beside the noise that its fit assumes."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from pipelines.cli import options
from pipelines.cli.next_commands import Given, command_line, print_next
from pipelines.cli.options import argument, option
from pipelines.cli.printing import error_console, give, print_table, publish, say, short, warn
from pipelines.diagnosis.documents import VersionDocument
from schemas.errors import WrongUse

PART = "Is the model good enough, and what is missing?"
ORDER = 250
SUMMARY = "Show the error of a model, version by version."
EXAMPLES = (
    "tumbleline history model.toml",
    "tumbleline history model.toml --dwells dwells.csv --fresh fresh.csv --output history.png",
)


def command(
    model: Annotated[Path, argument("MODEL", "A model file.")],
    dwells: Annotated[str, option("--dwells DWELLS", "A file in the exchange format, or a run of the archive.")] = "",
    fresh: options.FreshOption = "",
    temperatures: options.TemperaturesOption = "",
    fresh_temperatures: options.FreshTemperaturesOption = "",
    picture: Annotated[Path | None, option("--output -o FILE.png", "Draw it, as PNG, SVG or PDF.")] = None,
    effect_file: options.EffectFileOption = None,
    leave_out: options.LeaveOutOption = "",
    archive: options.ArchiveOption = None,
    *,
    as_json: options.JsonOption = False,
) -> None:
    """Show what each version of a model added, who, when, why, and the error on the run, on dwells left out and on a fresh run.

    Without --dwells only the changes are shown.
    """
    from pipelines.cli.inputs import add_effects, both_runs, without_dwells
    from pipelines.diagnosis.confirmation import change_row
    from pipelines.improvement.improvement import ImprovedTables, errors_by_version
    from pipelines.jobs.model_files import read_model, versions

    add_effects(effect_file)
    model_file = read_model(model)
    if picture is not None:
        from pipelines.drawing.picture import refuse_ending

        if not dwells:
            raise WrongUse("history: --output draws errors, they need --dwells; name the dwells too")
        refuse_ending(picture, "--output")
    if dwells:
        first, *others = both_runs(dwells, temperatures, fresh, fresh_temperatures, archive)
        tables = ImprovedTables(without_dwells(first, leave_out)[0], *others)
        rows = errors_by_version(versions(model_file), tables, lambda: error_console().status("fitting"))
    else:
        rows = [change_row(version) for version in versions(model_file)]
    if picture is not None:
        from pipelines.drawing.picture import picture as drawn
        from pipelines.report.diagnosis_pictures import evolution_chart

        chart = evolution_chart(rows, model_file.model.name)
        publish(picture, drawn(chart, picture.suffix.lower()), "picture")
    document = {"model": model_file.model.name, "file": str(model), "versions": rows}
    give(
        document,
        lambda _: _print(rows, model_file.model.name, partial(removal, model, effect_file or ())),
        as_json=as_json,
    )


def _print(rows: list[VersionDocument], name: str, removes: Callable[[str], str]) -> None:
    changes = [
        [str(row["version"]), _change(row), row["by"], row["at"][:16].replace("T", " "), row["why"]] for row in rows
    ]
    print_table(["version", "change", "by", "when", "why"], changes, title=f"Versions of {name}", fixed=2)
    if rows[0]["fitted_ug"] is None:
        return
    fresh = rows[0]["fresh_ug"] is not None
    again = ["fresh run\nµg"] if fresh else []
    errors = [
        [
            str(row["version"]),
            short(row["fitted_ug"]),
            short(row["heldout_ug"]),
            *([short(row["fresh_ug"])] if fresh else []),
            short(row["floor_ug"]),
        ]
        for row in rows
    ]
    heads = ["version", "fitted\nµg", "cross-validated\nµg", *again, "assumed noise\nµg"]
    print_table(heads, errors, title="Error, rms")
    for row in rows:
        if row["text"]:
            say(f"version {row['version']}: {row['text']}")
    say(
        "fitted: dwells of the fit · cross-validated: dwells predicted by a fit without them, the worst of poses, soaks and "
        "stretches of time · fresh run: coefficients unchanged, the bias change of each unit included · assumed noise: of the "
        "fit of each version, missing effects included",
        style="dim",
    )
    warn(dict.fromkeys(text for row in rows for text in row["warnings"]))
    refuted = [name for row in rows if row["confirmed"] is False for name in row["added"]]
    if refuted:
        say(
            f"{', '.join(refuted)}: refuted. The fresh run does not show the predicted change; remove it from the model.",
            style="bold red",
        )
        print_next([removes(effect) for effect in refuted if effect in rows[-1]["effects"]])


def removal(file: Path, effect_files: Sequence[Path], effect: str) -> str:
    """The command that removes an effect which a fresh run refutes."""
    words = ("--reason", "the fresh run is evidence against it", *Given(effect_files=effect_files).effects)
    return command_line("extend", str(file), "--remove", effect, *words)


def _change(row: VersionDocument) -> str:
    parts = [f"+ {name}" for name in row["added"]] + [f"− {name}" for name in row["removed"]]
    return "\n".join(parts) or f"{len(row['effects'])} effects"
