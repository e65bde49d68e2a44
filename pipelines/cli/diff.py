"""``tumbleline diff``: what differs between two runs, by how much, and because of what."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipelines.cli.options import STYLES, ArchiveOption, JsonOption, console, print_json, print_table, short

if TYPE_CHECKING:
    from rich.text import Text

PART = "Old data, new models"
ORDER = 530
SUMMARY = "Show what differs between two runs, by how much, and the cause."
EXAMPLES = (
    "tumbleline diff latest RE-RUN",
    "tumbleline diff RUN-A RUN-B --all",
)

SHOWN = 12


def command(
    run_a: Annotated[str, typer.Argument(metavar="RUN_A", help="A run's name, its beginning, or 'latest'.")],
    run_b: Annotated[str, typer.Argument(metavar="RUN_B", help="The run that it is compared with.")],
    archive: ArchiveOption = None,
    *,
    everything: Annotated[bool, typer.Option("--all", help="Show every change, not only the largest.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Tell which grades, coefficients and figures differ between two runs, by how much against their uncertainty, and why."""
    from pipelines.archive import Archive
    from pipelines.rerun.diff import diff

    store = Archive(archive)
    document = diff(store.run(run_a), store.run(run_b))
    if as_json:
        print_json(document)
        return
    _print(document, None if everything else SHOWN)


def _print(document: dict[str, Any], most: int | None) -> None:
    out = console()
    out.print(f"a  {document['a']}\nb  {document['b']}", markup=False)
    if document["same"]:
        out.print("no coefficient, figure or grade differs", style="bold green")
    _print_flips(document)
    _print_changes(document["coefficients"], ("effect", "name", "axis"), "coefficients", most)
    _print_changes(document["figures"], ("figure",), "figures", most)
    for side in ("only_a", "only_b"):
        if document[side]:
            out.print(f"only in {side[-1]}: {', '.join(document[side])}", markup=False, soft_wrap=True)
    _print_causes(document["because"])


def _print_flips(document: dict[str, Any]) -> None:
    flips = [row for row in document["units"] if row["flipped"]]
    if not flips:
        console().print(f"no grade flips among {len(document['units'])} units")
        return
    lines = [
        [row["unit"], *(_styled(o, g) for o, g in zip(row["outcome"], row["grade"], strict=True)), _reason(row)]
        for row in flips
    ]
    print_table(["unit", "a", "b", "because"], lines, title=f"{len(flips)} of {len(document['units'])} units flip")


def _styled(outcome: str, grade: str) -> Text:
    from rich.text import Text

    return Text.assemble((outcome, STYLES.get(outcome, "")), f" {grade}") if outcome else Text(grade or "not graded")


def _reason(row: dict[str, Any]) -> str:
    """The reasons that the one has and the other has not."""
    before, after = (set(filter(None, text.split("; "))) for text in row["reasons"])
    gone, new = (sorted(one.split(":")[0] for one in part) for part in (before - after, after - before))
    said = [f"now {name}" for name in new] + [f"no longer {name}" for name in gone if name not in new]
    return "; ".join(said)


def _print_changes(rows: list[dict[str, Any]], key: tuple[str, ...], what: str, most: int | None) -> None:
    if not rows:
        return
    out = console()
    both = [row for row in rows if not (math.isnan(row["a"]) or math.isnan(row["b"]))]
    lines = [_change_line(row, key) for row in both[:most]]
    if lines:
        heads = ["unit", what, "a", "b", "change", "over\nu(a)", "over\nu(b)"]
        title = f"{what}: {len(both)} differ, the largest against their uncertainty first"
        print_table(heads, lines, title=title, whole=2)
    new, gone = _apart(rows, "b"), _apart(rows, "a")
    for words, names in (("only in b", new), ("only in a", gone)):
        if names:
            out.print(f"{what} {words}: {', '.join(names)}", markup=False, soft_wrap=True)


def _change_line(row: dict[str, Any], key: tuple[str, ...]) -> list[str]:
    named = [str(row["unit"]), " ".join(str(row[name]) for name in key)]
    change = f"{short(row['change'])} {row['unit_text']}"
    return [*named, short(row["a"], 5), short(row["b"], 5), change, short(row["over_a"], 2), short(row["over_b"], 2)]


def _apart(rows: list[dict[str, Any]], side: str) -> list[str]:
    """Names of what only one of the runs has, each once."""
    other = "a" if side == "b" else "b"
    names = [row.get("effect") or row["figure"] for row in rows if math.isnan(row[other])]
    return sorted(set(names))


def _print_causes(rows: list[dict[str, Any]]) -> None:
    out = console()
    if not rows:
        out.print("because: data, code, model, limits and libraries are the same")
        return
    out.print("because of")
    code = [row["stage"] for row in rows if row["what"] == "code"]
    for row in rows:
        name = f" {row['name']}" if row["name"] else ""
        if row["what"] != "code":
            out.print(f"  {row['what']}{name}: {row['a']} → {row['b']}", markup=False, soft_wrap=True)
    if code:
        out.print(f"  code of {', '.join(code)}", markup=False, soft_wrap=True)
