"""``python -m docs.keys_page``: the reference of keys, faults and hidden effects, from the code; ``--check`` only compares."""

from __future__ import annotations

import sys
from pathlib import Path

from docs.generated_page import cell, write_or_check
from pipelines.cli.plan_keys import SUBJECTS

PAGE = Path(__file__).resolve().parent / "reference" / "keys.md"
HEAD = """\
# Keys and names

Written by `python -m docs.keys_page`; `tumbleline plan keys` shows the same lists. The meanings of the keys are in
`schemas/key_texts.toml`. Every file is TOML; the tables of recipes and stations are given in the order of the classes that check
them, and a table that several keys have is listed once.

## Names and folders

A recipe, limits, station, profile or preset is given by its path, or by its name. A name is searched in this order:

| place | example |
|---|---|
| folder of its kind in the working folder | `recipes/my.toml`, `limits/`, `stations/`, `profiles/`, `presets/` |
| folder of its kind of the user | `$XDG_CONFIG_HOME/tumbleline/recipes/my.toml`; by default `~/.config/tumbleline/` |
| built in | `production` |

A file of your own with the name of a built-in one is refused, so that a name means one file. The command says on standard error
which file it uses. The hash of a profile or preset of your own is part of the name of a measurement: a changed file is measured
anew. `tumbleline plan keys names` lists everything that is found.
"""
TITLES = {
    "recipe": "Recipe", "limits": "Limits", "station": "Station", "line": "Line", "fault": "Faults of a simulated station",
    "demo": "Hidden effects of `tumbleline demo`",
}  # fmt: skip
LEADS = {
    "fault": (
        "`tumbleline run --fault KIND:KEY=VALUE:KEY=VALUE`. Every kind also has `at_s` (start on the clock of the station, s) "
        "and `for_s` (duration, s; permanent by default). [Outcomes](faults.md).\n"
    ),
    "demo": "`tumbleline demo NAME` takes a name of either column, or `random`.\n",
}


def page() -> str:
    """The whole page as Markdown."""
    return "\n".join([HEAD, *(_section(subject) for subject in TITLES)]).rstrip() + "\n"


def _section(subject: str) -> str:
    rows = SUBJECTS[subject][1]()
    lines = [f"## {TITLES[subject]}\n", LEADS.get(subject, "")]
    for table in dict.fromkeys(row.get("table", "") for row in rows):
        own = [{k: v for k, v in row.items() if k != "table"} for row in rows if row.get("table", "") == table]
        heads = list(own[0])
        if table:
            lines.append(f"### `{table}`\n")
        lines += [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
        lines += [f"| {' | '.join(_cell(head, row[head]) for head in heads)} |" for row in own]
        lines.append("")
    return "\n".join(lines)


def _cell(head: str, text: str) -> str:
    quoted = text and head in {"key", "fault", "target", "keys", "default", "hidden effect"}
    return f"`{cell(text)}`" if quoted else cell(text)


if __name__ == "__main__":
    sys.exit(write_or_check(PAGE, page(), "docs.keys_page"))
