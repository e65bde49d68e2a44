"""``tumbleline archive diff``: differences between two runs, their size and their causes."""

import math
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from inertial.counts import number_of
from pipelines.archive import Archive
from pipelines.cli.options import ArchiveOption, JsonOption, argument, option
from pipelines.cli.printing import STYLES, give, print_table, say, short
from pipelines.stages.figures import plain_reason

if TYPE_CHECKING:
    from rich.text import Text


SHOWN = 12


def diff(
    run_a: Annotated[str, argument("RUN_A", "Name of a run, the beginning of it, or 'latest'.")],
    run_b: Annotated[str, argument("RUN_B", "The run to compare with.")],
    archive: ArchiveOption = None,
    *,
    everything: Annotated[bool, option("--all", "Show all changes; default: only the largest.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show which grades, coefficients and figures differ between two runs, relative to their uncertainty, and the causes."""
    from pipelines.rerun.diff import diff

    store = Archive(archive)
    document = diff(store.run(run_a), store.run(run_b))
    give(document, partial(_print, None if everything else SHOWN), as_json=as_json)


def _print(most: int | None, document: dict[str, Any]) -> None:
    say(f"a  {document['a']}\nb  {document['b']}")
    if document["same"]:
        say("no coefficient, figure or grade differs", style="bold green")
    _print_flips(document)
    _print_changes(document["coefficients"], ("effect", "name", "axis"), "coefficients", most)
    _print_changes(document["figures"], ("figure",), "figures", most)
    for side in ("only_a", "only_b"):
        if document[side]:
            say(f"only in {side[-1]}: {', '.join(document[side])}")
    _print_causes(document["because"])


def _print_flips(document: dict[str, Any]) -> None:
    flips = [row for row in document["units"] if row["flipped"]]
    if not flips:
        say(f"no grade differs ({number_of(len(document['units']), 'unit')})")
        return
    lines = [
        [row["unit"], *(_styled(o, g) for o, g in zip(row["outcome"], row["grade"], strict=True)), _reason(row)]
        for row in flips
    ]
    print_table(
        ["unit", "a", "b", "reason"],
        lines,
        title=f"grade differs for {len(flips)} of {number_of(len(document['units']), 'unit')}",
    )


def _styled(outcome: str, grade: str) -> "Text":
    from rich.text import Text

    return Text.assemble((outcome, STYLES.get(outcome, "")), f" {grade}") if outcome else Text(grade or "not graded")


def _reason(row: dict[str, Any]) -> str:
    """The reasons that only one of the runs gives."""
    before, after = (set(filter(None, plain_reason(text).split("; "))) for text in row["reasons"])
    gone, new = (sorted(reason.split(":")[0] for reason in part) for part in (before - after, after - before))
    changes = [f"now {name}" for name in new] + [f"no longer {name}" for name in gone if name not in new]
    return "; ".join(changes)


def _print_changes(rows: list[dict[str, Any]], key: tuple[str, ...], what: str, most: int | None) -> None:
    if not rows:
        return
    common = [row for row in rows if not (math.isnan(row["a"]) or math.isnan(row["b"]))]
    lines = [
        [
            str(row["unit"]),
            " ".join(str(row[name]) for name in key),
            *(short(row[side], 5) for side in ("a", "b")),
            f"{short(row['change'])} {row['unit_text']}",
            *(short(row[over], 2) for over in ("over_a", "over_b")),
        ]
        for row in common[:most]
    ]
    if lines:
        heads = ["unit", what, "a", "b", "change", "over\nu(a)", "over\nu(b)"]
        title = f"{what}: {len(common)} differ, largest change relative to the uncertainty first"
        print_table(heads, lines, title=title, fixed=2)
    new, gone = _apart(rows, "b"), _apart(rows, "a")
    for side, names in (("only in b", new), ("only in a", gone)):
        if names:
            say(f"{what} {side}: {', '.join(names)}")


def _apart(rows: list[dict[str, Any]], side: str) -> list[str]:
    """Names that only one of the runs has, each once."""
    other = "a" if side == "b" else "b"
    names = [row.get("effect") or row["figure"] for row in rows if math.isnan(row[other])]
    return sorted(set(names))


def _print_causes(rows: list[dict[str, Any]]) -> None:
    if not rows:
        say("causes: none found; data, code, model, limits and libraries are the same")
        return
    say("because of")
    code = [row["stage"] for row in rows if row["what"] == "code"]
    for row in rows:
        name = f" {row['name']}" if row["name"] else ""
        if row["what"] != "code":
            say(f"  {row['what']}{name}: {row['a']} → {row['b']}")
    if code:
        say(f"  code of {', '.join(code)}")
